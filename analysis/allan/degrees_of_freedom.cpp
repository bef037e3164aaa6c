#include "analysis/allan/degrees_of_freedom.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "analysis/allan/power_law.hpp"

namespace ringlock::allan {
namespace {

double binomial(int n, int k) {
    double b = 1.0;
    for (int i = 1; i <= k; ++i) b = b * (n - k + i) / i;
    return b;
}

/// Autocovariance of the d-th difference with step tau.
double s_z(double t, double filter, int alpha, int d) {
    double z = 0.0;
    for (int k = -d; k <= d; ++k) {
        const double sign = k % 2 == 0 ? 1.0 : -1.0;
        z += sign * binomial(2 * d, d + k) * phase_autocovariance(t + k, filter, alpha);
    }
    return z;
}

/// Sum over lags 0 < j < end of (1 - j/terms) s_z(j/strides)^2.
double sum_over_lags(double terms, std::int64_t strides, std::int64_t end, double filter, int alpha, int d) {
    constexpr std::int64_t fineness = 16;  // a block spans at most this part of its distance from a singular point
    double sum = 0.0;
    for (std::int64_t j = 1; j < end;) {
        const std::int64_t behind = j % strides;
        const std::int64_t distance = std::min(behind, strides - behind);
        const std::int64_t length = std::min(std::max<std::int64_t>(1, distance / fineness), end - j);
        const double middle = static_cast<double>(j) + 0.5 * static_cast<double>(length - 1);
        const double z = s_z(middle / static_cast<double>(strides), filter, alpha, d);
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
    double filter = 1.0;
    if (!shape.modified) filter = alpha <= 0 ? sampled : static_cast<double>(m);
    // Beyond d + 1 taus the terms of the stationary noises are uncorrelated, those of the others nearly.
    const std::int64_t end = std::min(term_count, (d + 1) * strides);
    const double z0 = s_z(0.0, filter, alpha, d);
    return terms * z0 * z0 / (z0 * z0 + 2.0 * sum_over_lags(terms, strides, end, filter, alpha, d));
}

}  // namespace ringlock::allan
