#include "analysis/noise/allan_variance.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "engine/core/units.hpp"

namespace ringlock::noise {
namespace {

/// Of a rate with covariance rms^2 exp(-|t|/T_c), at x = tau/T_c: 2 rms^2 (1 - (3 - 4 e^-x + e^-2x)/(2 x))/x, which for
/// small x begins with rms^2 x/3 times 2 and loses its digits as written.
double correlated_variance(double rms, double x) {
    const double bracket =
        x < 1e-3 ? x * x / 3.0 * (1.0 - 0.75 * x) : 1.0 - (3.0 - 4.0 * std::exp(-x) + std::exp(-2.0 * x)) / (2.0 * x);
    return 2.0 * rms * rms / x * bracket;
}

}  // namespace

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
    if (fit.correlated) {
        const double time_s = fit.correlated->correlation_time_s.value;
        const double rms = fit.correlated->rms_rate_deg_h.value;
        VarianceTerm term{"correlated", {}};
        for (const double tau : tau_s) term.variances.push_back(correlated_variance(rms, tau / time_s));
        out.push_back(std::move(term));
    }
    for (const Sinusoid& line : fit.sinusoids) {
        VarianceTerm term{fmt::format("{:.4g} Hz", line.frequency_hz.value), {}};
        for (const double tau : tau_s) {
            const double angle = std::numbers::pi * line.frequency_hz.value * tau;
            const double swing = line.rate_amplitude_deg_h.value * std::sin(angle) * std::sin(angle) / angle;
            term.variances.push_back(swing * swing);
        }
        out.push_back(std::move(term));
    }
    return out;
}

}  // namespace ringlock::noise
