#include "analysis/closure/samples/fit/score.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/closure/options.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

SampleScore score_of(const SampleFit& fit, const Rows& reported, double lattice_arcsec) {
    SampleScore score;
    score.log_likelihood = fit.log_likelihood();
    double count = 0.0;
    for (std::size_t i = 0; i < reported.size(); ++i) {
        if (!reported[i] || fit.deterministic(i)) continue;
        const double sd = fit.sd(i);
        double e = fit.innovations()[i] * sd;
        score.log_score -= 0.5 * e * e / (sd * sd) + std::log(sd) + 0.5 * std::log(units::two_pi);
        score.floor += sd * sd;
        if (lattice_arcsec > options.samples.fit.fine_lattice * sd) {
            const double x = fit.series().increment[i];
            const double predicted = x - e;
            const auto reach = static_cast<int>(std::ceil(6.0 * sd / lattice_arcsec)) + 1;
            const double middle = std::round(predicted / lattice_arcsec);
            double sum = 0.0;
            double mean = 0.0;
            for (int m = -reach; m <= reach; ++m) {
                const double value = (middle + m) * lattice_arcsec;
                const double z = (value - predicted) / sd;
                const double w = std::exp(-0.5 * z * z);
                sum += w;
                mean += w * value;
            }
            e = x - mean / sum;
            // The density's share of the step about each value.
            score.log_score -= std::log(sum * lattice_arcsec / (sd * std::sqrt(units::two_pi)));
        }
        score.error += e * e;
        count += 1.0;
    }
    count = std::max(count, 1.0);
    score.error = std::sqrt(score.error / count);
    score.floor = std::sqrt(score.floor / count);
    return score;
}

}  // namespace ringlock::closure
