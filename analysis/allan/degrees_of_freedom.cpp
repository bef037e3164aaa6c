#include "analysis/allan/degrees_of_freedom.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace ringlock::allan {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Generalised autocovariance of the integrated phase, up to a positive constant.
double s_w(double t, int alpha) {
    const double a = std::abs(t);
    if (a == 0.0) return 0.0;
    const double t2 = a * a;
    switch (alpha) {
        case 2:
            return -a;
        case 1:
            return t2 * std::log(a);
        case 0:
            return a * t2;
        case -1:
            return -t2 * t2 * std::log(a);
        case -2:
            return -a * t2 * t2;
        case -3:
            return t2 * t2 * t2 * std::log(a);
        case -4:
            return a * t2 * t2 * t2;
        default:
            throw std::domain_error("degrees of freedom: alpha outside -4...2");
    }
}

/// Autocovariance of the phase averaged over tau/F; F infinite is the limit of no averaging.
double s_x(double t, double filter, int alpha) {
    if (std::isinf(filter)) return s_w(t, alpha + 2);
    if (alpha == 1) {
        // t^2 ln t in units of the filter's length: the factor F^2 cancels and no digits are lost for large F.
        const double u = std::abs(t) * filter;
        if (u > 64.0) return -2.0 * std::log(std::abs(t)) - 3.0 + 1.0 / (6.0 * u * u);
        return 2.0 * s_w(u, 1) - s_w(u - 1.0, 1) - s_w(u + 1.0, 1) + 2.0 * std::log(filter);
    }
    return filter * filter * (2.0 * s_w(t, alpha) - s_w(t - 1.0 / filter, alpha) - s_w(t + 1.0 / filter, alpha));
}

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
        z += sign * binomial(2 * d, d + k) * s_x(t + k, filter, alpha);
    }
    return z;
}

}  // namespace

const std::vector<double>& DegreesOfFreedom::squares(int alpha, double strides, double filter) {
    auto [place, fresh] = tables_.try_emplace(Key{alpha, strides, filter});
    if (fresh) {
        const auto last = static_cast<std::size_t>((shape_.differences + 1) * strides);
        place->second.resize(last + 1);
        for (std::size_t j = 0; j <= last; ++j) {
            const double z = s_z(static_cast<double>(j) / strides, filter, alpha, shape_.differences);
            place->second[j] = z * z;
        }
    }
    return place->second;
}

double DegreesOfFreedom::operator()(int alpha, std::int64_t m, std::int64_t points) {
    const int d = shape_.differences;
    if (alpha > 2 || alpha + 2 * d <= 1) {
        throw std::domain_error("degrees of freedom: alpha does not suit this difference");
    }
    const std::int64_t span = shape_.modified ? m * (d + 1) : 1 + m * d;  // phase points under one term
    if (m < 1 || points < span) throw std::domain_error("degrees of freedom: no term fits the record");
    const std::int64_t strides = shape_.overlapping ? m : 1;
    const auto terms = static_cast<double>(1 + (points - span) / (m / strides));

    if (alpha == 2 && !shape_.modified) {  // only multiples of tau are correlated
        double sum = 1.0;
        for (int k = 1; k <= d; ++k) {
            const double ratio = binomial(2 * d, d + k) / binomial(2 * d, d);
            sum += 2.0 * std::max(0.0, 1.0 - static_cast<double>(k * strides) / terms) * ratio * ratio;
        }
        return terms / sum;
    }

    double scaled_strides = static_cast<double>(strides);
    double scaled_terms = terms;
    if (strides > exact_span_) {
        scaled_strides = static_cast<double>(exact_span_);
        scaled_terms = std::max(1.0, terms * scaled_strides / static_cast<double>(strides));
    }
    double filter = 1.0;
    if (!shape_.modified) {
        filter = static_cast<double>(m);
        if (m > exact_span_) filter = alpha == 1 ? static_cast<double>(exact_span_) : infinity;
    }
    const std::vector<double>& z2 = squares(alpha, scaled_strides, filter);
    const double end = std::min(scaled_terms, (d + 1) * scaled_strides);
    double sum = z2[0];
    for (std::size_t j = 1; static_cast<double>(j) < end; ++j) {
        sum += 2.0 * (1.0 - static_cast<double>(j) / scaled_terms) * z2[j];
    }
    // Flicker phase noise depends on the bandwidth through the variance alone, which is known without scaling.
    const double z0 = alpha == 1 && !shape_.modified ? s_z(0.0, static_cast<double>(m), alpha, d) : std::sqrt(z2[0]);
    return scaled_terms * z0 * z0 / sum;
}

}  // namespace ringlock::allan
