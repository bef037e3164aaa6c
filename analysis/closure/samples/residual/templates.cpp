#include "analysis/closure/samples/residual/templates.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "analysis/closure/stats/p_values.hpp"

namespace ringlock::closure {

Columns taken_by(const SampleFit& fit, const Columns& columns) {
    Columns taken;
    for (const auto& column : columns) taken.push_back(fit.as_taken(column));
    return taken;
}

void test_templates(const SampleFit& fit, Where where, const std::string& subject, const Templates& of,
                    SampleResidualTests& tests) {
    double chi2 = 0.0;
    int rank = 0;
    std::size_t at = 0;
    for (std::size_t place = 0; place < of.count; ++place) {
        const auto score = fit.score(taken_by(fit, of.columns(place)));
        if (score.rank == 0 || score.chi2 <= chi2) continue;
        chi2 = score.chi2;
        rank = score.rank;
        at = place;
    }
    if (rank == 0) return;
    const double cost = rank + std::log(static_cast<double>(of.count));
    const double p = of_several(chi2_tail(chi2, rank), static_cast<double>(of.count));
    tests.push_back({{where, subject, p, of.said(at), 0.5 * chi2 - cost}, cost, [columns = of.columns, at] {
                         return columns(at);
                     }});
    tests.back().trends = of.trends;
}

}  // namespace ringlock::closure
