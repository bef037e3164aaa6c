#include "analysis/allan/allan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/allan/degrees_of_freedom.hpp"
#include "analysis/allan/interval.hpp"
#include "analysis/allan/noise_identification.hpp"
#include "engine/core/error.hpp"

namespace ringlock::allan {
namespace {

/// Sum of squared second differences over `terms` starts, `stride` apart. Eight running sums, always added in one
/// order: the compiler may use vectors and the result does not depend on it.
double sum_of_squares(const double* x, std::size_t m, std::size_t stride, std::size_t terms) {
    constexpr std::size_t lanes = 8;
    double sums[lanes] = {};
    std::size_t i = 0;
    if (stride == 1) {
        for (; i + lanes <= terms; i += lanes) {
            for (std::size_t k = 0; k < lanes; ++k) {
                const double z = (x[i + k + 2 * m] - x[i + k + m]) - (x[i + k + m] - x[i + k]);
                sums[k] += z * z;
            }
        }
    }
    for (; i < terms; ++i) {
        const std::size_t at = i * stride;
        const double z = (x[at + 2 * m] - x[at + m]) - (x[at + m] - x[at]);
        sums[i % lanes] += z * z;
    }
    return ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
}

/// Identifies the noise at each factor; beyond the last one with enough points what was found there is kept. With fewer
/// than 100 points the redder of what is found there and an octave below is taken: so few points tell alpha to about
/// +-1, and a false white phase noise would claim thousands of degrees of freedom where there are a few.
class NoisePerFactor {
   public:
    explicit NoisePerFactor(std::span<const double> phase)
        : phase_(phase),
          steps_(static_cast<std::int64_t>(phase.size()) - 1),
          last_(steps_ / (noise_identification_points - 1)) {}

    int operator()(std::int64_t m) {
        if (last_ < 1) return 0;
        if (m < last_) return found_at(m);
        if (!known_) kept_ = found_at(last_);
        known_ = true;
        return kept_;
    }

   private:
    int found_at(std::int64_t m) const {
        constexpr std::int64_t sure = 100;
        const int found = identify_noise(phase_, m).value_or(0);
        if (m == 1 || steps_ / m >= sure) return found;
        return std::min(found, identify_noise(phase_, m / 2).value_or(0));
    }

    std::span<const double> phase_;
    std::int64_t steps_ = 0;
    std::int64_t last_ = 0;
    bool known_ = false;
    int kept_ = 0;
};

}  // namespace

std::string_view name(Estimator estimator) { return estimator == Estimator::adev ? "adev" : "oadev"; }

std::int64_t largest_factor(Estimator, std::int64_t phase_points) {
    return std::max<std::int64_t>(0, (phase_points - 1) / 2);
}

std::vector<std::int64_t> octave_factors(std::int64_t largest) {
    std::vector<std::int64_t> m;
    for (std::int64_t k = 1; k <= largest; k *= 2) m.push_back(k);
    return m;
}

std::vector<std::int64_t> decade_factors(std::int64_t largest) {
    std::vector<std::int64_t> m;
    for (std::int64_t decade = 1; decade <= largest; decade *= 10) {
        for (const std::int64_t step : {1, 2, 4}) {
            if (step * decade <= largest) m.push_back(step * decade);
        }
    }
    return m;
}

std::vector<std::int64_t> all_factors(std::int64_t largest) {
    std::vector<std::int64_t> m(static_cast<std::size_t>(std::max<std::int64_t>(0, largest)));
    for (std::size_t i = 0; i < m.size(); ++i) m[i] = static_cast<std::int64_t>(i) + 1;
    return m;
}

std::vector<Point> deviation(Estimator estimator, std::span<const double> phase, double tau0_s,
                             std::span<const std::int64_t> factors, const Options& options) {
    check_deviation_input(tau0_s, options.confidence);
    const auto points = static_cast<std::int64_t>(phase.size());
    const std::int64_t largest = largest_factor(estimator, points);
    const bool overlapping = estimator == Estimator::oadev;
    const EstimatorShape shape{.differences = 2, .modified = false, .overlapping = overlapping};
    NoisePerFactor noise(phase);

    std::vector<Point> out;
    out.reserve(factors.size());
    for (const std::int64_t m : factors) {
        if (m < 1 || m > largest) {
            throw InputError(fmt::format(
                "averaging factor {}: {} of {} phase points (one more than increments or rates) allows 1 to {}", m,
                name(estimator), points, largest));
        }
        Point p;
        p.m = m;
        p.tau_s = static_cast<double>(m) * tau0_s;
        p.terms = overlapping ? points - 2 * m : (points - 1) / m - 1;
        const double sum =
            sum_of_squares(phase.data(), static_cast<std::size_t>(m), overlapping ? 1 : static_cast<std::size_t>(m),
                           static_cast<std::size_t>(p.terms));
        p.dev = std::sqrt(sum / (2.0 * static_cast<double>(p.terms))) / p.tau_s;
        p.alpha = noise(m);
        p.edf = degrees_of_freedom(shape, p.alpha, m, points);
        set_interval(p, options.confidence);
        out.push_back(p);
    }
    return out;
}

}  // namespace ringlock::allan
