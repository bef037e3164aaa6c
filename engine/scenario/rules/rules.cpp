#include "engine/scenario/rules/rules.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/units.hpp"
#include "engine/scenario/active_effects.hpp"

namespace ringlock::scenario {

double peak_rate_deg_h(const Scenario& s) { return s.dither.peak_rate_deg_s * units::deg_h_per_deg_s; }

double dither_rad_s(const Scenario& s) { return units::two_pi * s.dither.frequency_hz; }

double phase_amplitude_rad(const Scenario& s) {
    return units::two_pi * peak_rate_deg_h(s) / (s.gyro.scale_factor_arcsec * dither_rad_s(s));
}

double largest_asymmetry(const Scenario& s) {
    return std::abs(configured_setup(s).dither_asymmetry_ratio) + sigmas * s.ensemble.dither_asymmetry_sd_ratio;
}

std::vector<std::string> with_keys_of_effects(const Scenario& s, std::vector<std::string> keys,
                                              bool (*differ)(const gyro::Setup&, const gyro::Setup&)) {
    for (const auto& [effect, values] : active_effects(s)) {
        gyro::Setup setup;
        effect->configure(*values, setup);
        if (!differ(setup, gyro::Setup{})) continue;
        for (std::string& key : keys_of(*effect)) keys.push_back(std::move(key));
    }
    return keys;
}

std::vector<std::string> keys_by_rate(std::vector<RateOfKeys> rates) {
    // Stable, so that equal rates keep the order of effects.
    std::stable_sort(rates.begin(), rates.end(),
                     [](const RateOfKeys& a, const RateOfKeys& b) { return a.rate_deg_h > b.rate_deg_h; });
    std::vector<std::string> keys;
    for (const RateOfKeys& rate : rates) keys.insert(keys.end(), rate.keys.begin(), rate.keys.end());
    return keys;
}

std::vector<std::string> keys_of_rates(const Scenario& s) {
    std::vector<RateOfKeys> rates;
    rates.push_back({exposure(s).input_rate_deg_h,
                     has_profile(s.input) ? std::vector<std::string>{"input.profile_rate_deg_h"}
                                          : std::vector<std::string>{"input.rate_deg_h", "input.sweep_stop_deg_h"}});
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        const double rate = bounds.certain.rate_deg_h + sigmas * bounds.rate_sd_deg_h;
        if (rate > 0.01 * peak_rate_deg_h(s)) rates.push_back({rate, keys_of(*bounds.effect)});
    }
    return keys_by_rate(std::move(rates));
}

}  // namespace ringlock::scenario
