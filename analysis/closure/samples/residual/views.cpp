#include "analysis/closure/samples/residual/views.hpp"

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

void test_places(const SampleFit& fit, Where where, const std::string& view, const Places& of, Views& views) {
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
    views.push_back(
        {{where, view, p, of.said(at), 0.5 * chi2 - cost}, cost, [columns = of.columns, at] { return columns(at); }});
    views.back().courses = of.courses;
}

}  // namespace ringlock::closure
