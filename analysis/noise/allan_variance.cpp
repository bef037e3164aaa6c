#include "analysis/noise/allan_variance.hpp"

#include <numbers>

#include "engine/core/units.hpp"

namespace ringlock::noise {

std::vector<VarianceTerm> variance_terms(const NoiseFit& fit, const std::vector<double>& tau_s) {
    std::vector<VarianceTerm> out;
    const auto add = [&](const char* name, const Coefficient& c, const auto& variance) {
        if (!c.resolved) return;
        VarianceTerm term{name, {}};
        for (const double tau : tau_s) term.variances.push_back(variance(*c.value, tau));
        out.push_back(std::move(term));
    };
    add("Q", fit.quantization_arcsec, [](double q, double tau) { return 3.0 * q * q / (tau * tau); });
    add("N", fit.arw_deg_rt_h, [](double n, double tau) {
        const double per_rt_s = n / units::deg_rt_h_per_arcsec_rt_s;
        return per_rt_s * per_rt_s / tau;
    });
    add("B", fit.bias_instability_deg_h,
        [](double b, double) { return 2.0 * std::numbers::ln2 / std::numbers::pi * b * b; });
    add("K", fit.rrw_deg_h_rt_h, [](double k, double tau) { return k * k / 3600.0 * tau / 3.0; });
    add("R", fit.rate_ramp_deg_h_h, [](double r, double tau) {
        const double gained = r / 3600.0 * tau;
        return 0.5 * gained * gained;
    });
    return out;
}

}  // namespace ringlock::noise
