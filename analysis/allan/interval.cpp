#include "analysis/allan/interval.hpp"

#include <fmt/format.h>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

#include "engine/core/error.hpp"

namespace ringlock::allan {
// The inversion of the incomplete gamma function takes 0.3 ms at 1e8 degrees of freedom. From 1e5 on the expansion of
// Cornish and Fisher does (Goldberg and Levine, Ann. Math. Stat. 17 (1946) 216): its error is of the order of
// edf^(-5/2), 3e-13.
double relative_chi_squared_quantile(double edf, double probability) {
    constexpr double all = 1e30;  // known to the last digit of a double
    if (edf > all) return 1.0;
    if (edf < 1e5) return boost::math::quantile(boost::math::chi_squared(edf), probability) / edf;
    const double z = boost::math::quantile(boost::math::normal(), probability);
    const double z2 = z * z;
    const double root = std::sqrt(2.0 * edf);
    const double above = z * root + 2.0 / 3.0 * (z2 - 1.0) + z * (z2 - 7.0) / (9.0 * root) -
                         (6.0 * z2 * z2 + 14.0 * z2 - 32.0) / (405.0 * edf);
    return 1.0 + above / edf;
}

void check_deviation_input(double tau0_s, double confidence) {
    if (!(tau0_s > 0.0) || !std::isfinite(tau0_s)) {
        throw InputError(fmt::format("sampling interval {} s: must be a positive number", tau0_s));
    }
    if (!(confidence > 0.0 && confidence < 1.0)) {
        throw InputError(fmt::format("confidence {}: must lie between 0 and 1", confidence));
    }
}

void set_interval(Point& point, double confidence) {
    point.lo = point.dev / std::sqrt(relative_chi_squared_quantile(point.edf, 0.5 * (1.0 + confidence)));
    point.hi = point.dev / std::sqrt(relative_chi_squared_quantile(point.edf, 0.5 * (1.0 - confidence)));
}

}  // namespace ringlock::allan
