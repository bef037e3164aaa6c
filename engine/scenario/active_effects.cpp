#include "engine/scenario/active_effects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::scenario {

std::vector<ActiveEffect> active_effects(const Scenario& scenario) {
    std::vector<ActiveEffect> active;
    for (const effects::Effect* effect : effects::registry()) {
        const auto values = scenario.effects.find(std::string(effect->name()));
        if (values != scenario.effects.end() && effect->active(values->second)) {
            active.push_back({effect, &values->second});
        }
    }
    return active;
}

std::vector<std::string> keys_of(const effects::Effect& effect) {
    std::vector<std::string> keys;
    for (const effects::Parameter& parameter : effect.parameters()) {
        keys.push_back(fmt::format("effects.{}.{}", effect.name(), parameter.name));
    }
    return keys;
}

gyro::Setup configured_setup(const Scenario& scenario) {
    gyro::Setup setup;
    setup.scale_factor_arcsec = scenario.gyro.scale_factor_arcsec;
    setup.lockin_threshold_deg_h = scenario.gyro.lockin_threshold_deg_h;
    setup.dither_frequency_hz = scenario.dither.frequency_hz;
    setup.dither_peak_rate_deg_s = scenario.dither.peak_rate_deg_s;
    for (const auto& [effect, values] : active_effects(scenario)) effect->configure(*values, setup);
    return setup;
}

InputRange input_range(const InputRate& input) {
    if (has_profile(input) && !input.profile_rate_deg_h.empty()) {
        const auto [lowest, highest] =
            std::minmax_element(input.profile_rate_deg_h.begin(), input.profile_rate_deg_h.end());
        return {*lowest, *highest};
    }
    const double last = input.sweep_points > 1 ? input.sweep_stop_deg_h : input.rate_deg_h;
    return {std::min(input.rate_deg_h, last), std::max(input.rate_deg_h, last)};
}

namespace {

/// Steepest slope of a profile [its unit per second].
double steepest_slope(const std::vector<double>& times_s, const std::vector<double>& values) {
    double steepest = 0.0;
    for (std::size_t i = 1; i < std::min(times_s.size(), values.size()); ++i) {
        steepest = std::max(steepest, std::abs(values[i] - values[i - 1]) / (times_s[i] - times_s[i - 1]));
    }
    return steepest;
}

/// Largest magnitude of the profile's temperature less that at the start.
double largest_change_k(const Environment& environment) {
    if (environment.profile_time_s.empty() || environment.profile_temperature_k.empty()) return 0.0;
    double largest = 0.0;
    for (const double time_s : environment.profile_time_s) {
        largest = std::max(largest, std::abs(temperature_change_k(environment, time_s)));
    }
    return largest;
}

}  // namespace

double input_slope_deg_h_s(const InputRate& input) {
    return steepest_slope(input.profile_time_s, input.profile_rate_deg_h);
}

effects::Exposure exposure(const Scenario& scenario) {
    const Environment& environment = scenario.environment;
    const double ramp_k_per_h = std::abs(environment.temperature_ramp_k_per_h);
    const auto [lowest, highest] = input_range(scenario.input);
    effects::Exposure exposure;
    exposure.duration_h = simulated_s(scenario) / 3600.0;
    exposure.temperature_change_k =
        ramp_k_per_h * exposure.duration_h + environment.temperature_swing_k + largest_change_k(environment);
    exposure.temperature_slope_k_per_h =
        3600.0 * steepest_slope(environment.profile_time_s, environment.profile_temperature_k) + ramp_k_per_h +
        environment.temperature_swing_k * units::two_pi * 3600.0 / environment.temperature_period_s;
    exposure.input_rate_deg_h = std::max(std::abs(lowest), std::abs(highest));
    exposure.input_slope_deg_h_s = input_slope_deg_h_s(scenario.input);
    return exposure;
}

std::vector<EffectBounds> bounds_of_effects(const Scenario& scenario) {
    const effects::Exposure exposed = exposure(scenario);
    const double asymmetry = std::abs(configured_setup(scenario).dither_asymmetry_ratio) +
                             sigmas * scenario.ensemble.dither_asymmetry_sd_ratio;
    const double half_cycle_s = (1.0 - asymmetry) / (2.0 * scenario.dither.frequency_hz);
    std::vector<EffectBounds> bounds;
    for (const auto& [effect, values] : active_effects(scenario)) {
        bounds.push_back({effect, effect->bounds(*values, exposed),
                          effects::rate_sd_deg_h(effect->rate_noise(*values), half_cycle_s, exposed.duration_h)});
    }
    return bounds;
}

double threshold_change_relative(const Scenario& scenario) {
    double change = 0.0;
    for (const EffectBounds& bounds : bounds_of_effects(scenario)) {
        change += bounds.certain.threshold_relative * (1.0 + change);  // factors multiply
    }
    return change;
}

}  // namespace ringlock::scenario
