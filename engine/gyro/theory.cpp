#include "engine/gyro/theory.hpp"

#include <boost/math/special_functions/bessel.hpp>
#include <cmath>
#include <numbers>

#include "engine/core/units.hpp"

namespace ringlock::gyro {

namespace {
double angular_frequency_rad_s(const Setup& setup) { return units::two_pi * setup.dither_frequency_hz; }
double peak_rate_arcsec_s(const Setup& setup) { return setup.dither_peak_rate_deg_s * units::arcsec_per_deg; }
}  // namespace

double turn_kick_rad(const Setup& setup) {
    return units::two_pi * setup.lockin_threshold_deg_h /
           std::sqrt(setup.scale_factor_arcsec * peak_rate_arcsec_s(setup) * angular_frequency_rad_s(setup));
}

double angle_random_walk_deg_rt_h(const Setup& setup) {
    return setup.lockin_threshold_deg_h *
           std::sqrt(setup.scale_factor_arcsec / (units::two_pi * peak_rate_arcsec_s(setup))) *
           units::deg_rt_h_per_arcsec_rt_s;
}

double randomised_kick_variance_rad2(const Setup& setup) {
    const double kick = turn_kick_rad(setup);
    const double r2 = -std::expm1(-0.25 * kick * kick);
    // 2 Li2(x) = 2 (x + x^2/4 + x^3/9 + ...); for kicks of many radians x is near one, where Li2(x) = pi^2/6 - ln(x)
    // ln(1 - x) - Li2(1 - x).
    const auto series = [](double x) {
        double sum = 0.0;
        double power = x;
        for (int k = 1; power > 1e-18; ++k, power *= x) sum += power / (k * k);
        return sum;
    };
    if (r2 <= 0.5) return 2.0 * series(r2);
    const double rest = std::exp(-0.25 * kick * kick);
    return 2.0 * (units::pi * units::pi / 6.0 - (rest > 0.0 ? std::log(r2) * std::log(rest) : 0.0) - series(rest));
}

double randomised_arw_deg_rt_h(const Setup& setup) {
    const double kick = turn_kick_rad(setup);
    if (kick == 0.0) return 0.0;
    return angle_random_walk_deg_rt_h(setup) * std::sqrt(randomised_kick_variance_rad2(setup) / (0.5 * kick * kick));
}

double modulation_depth_rad(const Setup& setup) {
    return units::two_pi * peak_rate_arcsec_s(setup) / (setup.scale_factor_arcsec * angular_frequency_rad_s(setup));
}

double band_half_width_deg_h(const Setup& setup, int order) {
    return setup.lockin_threshold_deg_h * std::abs(boost::math::cyl_bessel_j(order, modulation_depth_rad(setup)));
}

double half_turn_delay_rad(const Setup& setup) {
    const double w = angular_frequency_rad_s(setup);
    const double b = units::two_pi / setup.scale_factor_arcsec * setup.lockin_threshold_deg_h;
    const double acceleration = modulation_depth_rad(setup) * w * w;
    return b * b / (2.0 * acceleration) *
           (std::log(2.0 * std::sqrt(acceleration) / w) + 0.5 * (std::numbers::egamma + std::numbers::ln2));
}

double band_centre_deg_h(const Setup& setup, int order) {
    return order * setup.scale_factor_arcsec * angular_frequency_rad_s(setup) / units::two_pi;
}

double band_envelope_deg_h(const Setup& setup) {
    return setup.lockin_threshold_deg_h * std::sqrt(2.0 / (units::pi * modulation_depth_rad(setup)));
}

double adler_rate_deg_h(double rate_deg_h, double lockin_threshold_deg_h) {
    if (std::abs(rate_deg_h) <= lockin_threshold_deg_h) return 0.0;
    return std::copysign(std::sqrt((rate_deg_h - lockin_threshold_deg_h) * (rate_deg_h + lockin_threshold_deg_h)),
                         rate_deg_h);
}

double turn_map_modulus(double b_rad_s, double acceleration_rad_s2) {
    return std::exp(units::pi * b_rad_s * b_rad_s / (4.0 * acceleration_rad_s2));
}

}  // namespace ringlock::gyro
