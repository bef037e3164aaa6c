#include "analysis/closure/stats/p_values.hpp"

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

double cost_of_amplitudes(double gain, int amplitudes) {
    if (amplitudes == 0) return 0.0;
    const double k = amplitudes;
    return 2.0 * gain > k ? 0.5 * k * (1.0 + std::log(2.0 * gain / k)) : std::max(gain, 0.0);
}

double davies_look_elsewhere(double chi2, const std::vector<double>& roots) {
    double variation = 0.0;
    for (std::size_t i = 1; i < roots.size(); ++i) variation += std::abs(roots[i] - roots[i - 1]);
    // V u^((s-1)/2) exp(-u/2) 2^(-s/2)/Gamma(s/2) over (u/2)^(s/2-1) exp(-u/2)/Gamma(s/2), the tail of s degrees.
    return 1.0 + 0.5 * variation * std::sqrt(std::max(chi2, 0.0));
}

double look_elsewhere_of_step(double chi2, double share_at_ends) {
    const double b = std::sqrt(std::max(chi2, 1.0));
    const double density = std::exp(-0.5 * b * b) / std::sqrt(units::two_pi);
    const double range = 2.0 * std::log((1.0 - share_at_ends) / share_at_ends);
    const double p = density * ((b - 1.0 / b) * range + 4.0 / b);
    return std::max(1.0, p / chi2_tail(b * b, 1));
}

double look_elsewhere_of_frequency(double chi2, double cycles) {
    return std::max(1.0, std::sqrt(units::pi / 3.0) * cycles * std::sqrt(0.5 * std::max(chi2, 0.0)));
}

double davies_bound(double chi2, const std::vector<double>& roots, int freedom) {
    return std::min(1.0, chi2_tail(chi2, freedom) * davies_look_elsewhere(chi2, roots));
}

}  // namespace ringlock::closure
