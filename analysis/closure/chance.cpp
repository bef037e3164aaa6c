#include "analysis/closure/chance.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::closure {

double chi2_tail(double x, int freedom) {
    if (!(x > 0.0) || freedom < 1) return 1.0;
    return boost::math::cdf(boost::math::complement(boost::math::chi_squared(freedom), x));
}

double of_several(double p, double count) { return p >= 1.0 ? 1.0 : -std::expm1(count * std::log1p(-p)); }

double davies_bound(double chi2, const std::vector<double>& roots) {
    // The two-sided statistic wanders in its root; half of the variation is upwards, on either side of zero.
    double variation = 0.0;
    for (std::size_t i = 1; i < roots.size(); ++i) variation += std::abs(roots[i] - roots[i - 1]);
    return std::min(1.0, chi2_tail(chi2, 1) + variation * std::exp(-0.5 * chi2) / std::sqrt(2.0 * units::pi));
}

}  // namespace ringlock::closure
