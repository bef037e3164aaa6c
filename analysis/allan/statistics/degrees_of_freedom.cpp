#include "analysis/allan/statistics/degrees_of_freedom.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "analysis/allan/statistics/power_law.hpp"

namespace ringlock::allan {
namespace {

double binomial(int n, int k) {
    double b = 1.0;
    for (int i = 1; i <= k; ++i) b = b * (n - k + i) / i;
    return b;
}

/// Phase as the differences see it: sampled or averaged over a length (filter, see phase_autocovariance), or the mean
/// of the samples of a tau.
struct SeenPhase {
    int alpha = 0;
    double filter = 1.0;
    std::int64_t samples = 1;

    double autocovariance(double t) const {
        if (samples == 1) return phase_autocovariance(t, filter, alpha);
        const auto count = static_cast<double>(samples);
        double sum = 0.0;
        for (std::int64_t k = 1 - samples; k < samples; ++k) {
            const auto lag = static_cast<double>(k);
            sum += (count - std::abs(lag)) * phase_autocovariance(t + lag / count, filter, alpha);
        }
        return sum / (count * count);
    }
};

/// Autocovariance of the d-th difference with step tau.
double s_z(double t, const SeenPhase& phase, int d) {
    double z = 0.0;
    for (int k = -d; k <= d; ++k) {
        const double sign = k % 2 == 0 ? 1.0 : -1.0;
        z += sign * binomial(2 * d, d + k) * phase.autocovariance(t + k);
    }
    return z;
}

/// Sum over lags 0 < j < end of (1 - j/terms) s_z(j/strides)^2.
double sum_over_lags(double terms, std::int64_t strides, std::int64_t end, const SeenPhase& phase, int d) {
    constexpr std::int64_t fineness = 16;  // a block spans at most this part of its distance from a singular point
    double sum = 0.0;
    for (std::int64_t j = 1; j < end;) {
        const std::int64_t behind = j % strides;
        const std::int64_t distance = std::min(behind, strides - behind);
        const std::int64_t length = std::min(std::max<std::int64_t>(1, distance / fineness), end - j);
        const double middle = static_cast<double>(j) + 0.5 * static_cast<double>(length - 1);
        const double z = s_z(middle / static_cast<double>(strides), phase, d);
        sum += static_cast<double>(length) * (1.0 - middle / terms) * z * z;
        j += length;
    }
    return sum;
}

}  // namespace

double degrees_of_freedom(const EstimatorShape& shape, int alpha, std::int64_t m, std::int64_t points) {
    const int d = shape.differences;
    if (d < 1 || alpha > 2 || alpha + 2 * d <= 1) {
        throw std::domain_error("degrees of freedom: alpha does not suit this difference");
    }
    const std::int64_t span = shape.modified ? m * (d + 1) : 1 + m * d;  // phase points under one term
    if (m < 1 || points < span) throw std::domain_error("degrees of freedom: no term fits the record");
    const std::int64_t bound = shape.starts_per_tau > 0 ? std::min(m, shape.starts_per_tau) : m;
    const std::int64_t strides = shape.overlapping ? bound : 1;
    if (m % strides != 0) throw std::domain_error("degrees of freedom: the stride is no whole number of samples");
    const std::int64_t term_count = 1 + (points - span) / (m / strides);
    const auto terms = static_cast<double>(term_count);

    if (alpha == 2 && !shape.modified) {  // only multiples of tau are correlated
        double sum = 1.0;
        for (int k = 1; k <= d; ++k) {
            const double ratio = binomial(2 * d, d + k) / binomial(2 * d, d);
            sum += 2.0 * std::max(0.0, 1.0 - static_cast<double>(k * strides) / terms) * ratio * ratio;
        }
        return terms / sum;
    }
    // The mean of few samples is no average over tau: at m = 2 it has 7 % more degrees, and the excess falls with
    // 1/m^2.
    constexpr std::int64_t few = 8;
    SeenPhase phase{.alpha = alpha};
    if (!shape.modified) {
        phase.filter = alpha <= 0 ? sampled : static_cast<double>(m);
    } else if (alpha <= 0 && m <= few) {
        phase.filter = sampled;
        phase.samples = m;
    }
    // Beyond d + 1 taus the terms of the stationary noises are uncorrelated, those of the others nearly.
    const std::int64_t end = std::min(term_count, (d + 1) * strides);
    const double z0 = s_z(0.0, phase, d);
    return terms * z0 * z0 / (z0 * z0 + 2.0 * sum_over_lags(terms, strides, end, phase, d));
}

}  // namespace ringlock::allan
