#include "analysis/allan/statistics/power_law.hpp"

#include <cmath>
#include <stdexcept>

namespace ringlock::allan {
namespace {

/// Generalised autocovariance of the integrated phase.
double integrated(double t, int alpha) {
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
            throw std::domain_error("power-law noise: alpha outside -4...2");
    }
}

}  // namespace

double phase_autocovariance(double t, double filter, int alpha) {
    if (std::isinf(filter)) return integrated(t, alpha + 2);
    if (alpha == 1) {
        // t^2 ln t in units of the filter's length: the factor F^2 cancels and no digits are lost for large F.
        const double u = std::abs(t) * filter;
        if (u > 64.0) return -2.0 * std::log(std::abs(t)) - 3.0 + 1.0 / (6.0 * u * u);
        return 2.0 * integrated(u, 1) - integrated(u - 1.0, 1) - integrated(u + 1.0, 1) + 2.0 * std::log(filter);
    }
    return filter * filter *
           (2.0 * integrated(t, alpha) - integrated(t - 1.0 / filter, alpha) - integrated(t + 1.0 / filter, alpha));
}

}  // namespace ringlock::allan
