#include "engine/scenario/scenario.hpp"

#include <algorithm>
#include <cmath>

#include "engine/effects/effect.hpp"

namespace ringlock::scenario {

EffectSettings default_effect_settings() {
    EffectSettings settings;
    for (const effects::Effect* effect : effects::registry()) {
        auto& values = settings[std::string(effect->name())];
        for (const effects::Parameter& p : effect->parameters()) values.emplace(p.name, p.default_value);
    }
    return settings;
}

bool temperature_varies(const Environment& environment) {
    const auto& profile = environment.profile_temperature_k;
    const bool moves = std::any_of(profile.begin(), profile.end(), [&](double k) { return k != profile.front(); });
    return moves || environment.temperature_ramp_k_per_h != 0.0 || environment.temperature_swing_k != 0.0;
}

double profile_value(const std::vector<double>& times_s, const std::vector<double>& values, double time_s) {
    const auto after = std::upper_bound(times_s.begin(), times_s.end(), time_s);
    if (after == times_s.begin()) return values.front();
    if (after == times_s.end()) return values.back();
    const auto i = static_cast<std::size_t>(after - times_s.begin());
    const double share = (time_s - times_s[i - 1]) / (times_s[i] - times_s[i - 1]);
    return values[i - 1] + share * (values[i] - values[i - 1]);
}

double temperature_change_k(const Environment& environment, double time_s) {
    if (!environment.profile_time_s.empty()) {
        return profile_value(environment.profile_time_s, environment.profile_temperature_k, time_s) -
               profile_value(environment.profile_time_s, environment.profile_temperature_k, 0.0);
    }
    const double phase = 2.0 * std::numbers::pi * std::fmod(time_s / environment.temperature_period_s, 1.0);
    return environment.temperature_ramp_k_per_h * time_s / 3600.0 + environment.temperature_swing_k * std::sin(phase);
}

double input_rate_deg_h(const InputRate& input, std::int64_t point) {
    if (point == 0) return input.rate_deg_h;
    if (point == input.sweep_points - 1) return input.sweep_stop_deg_h;
    const double fraction = static_cast<double>(point) / static_cast<double>(input.sweep_points - 1);
    return input.rate_deg_h + fraction * (input.sweep_stop_deg_h - input.rate_deg_h);
}

bool has_profile(const InputRate& input) { return !input.profile_time_s.empty(); }

double profile_rate_deg_h(const InputRate& input, double time_s) {
    return profile_value(input.profile_time_s, input.profile_rate_deg_h, time_s);
}

double profile_angle_arcsec(const InputRate& input, double start_s, double duration_s) {
    // 1 deg/h is 1 arcsec/s. The rate is linear between the points: the trapezium is exact.
    const double end_s = start_s + duration_s;
    double angle = 0.0;
    double from_s = start_s;
    double from_rate = profile_rate_deg_h(input, start_s);
    const auto& times = input.profile_time_s;
    for (auto point = std::upper_bound(times.begin(), times.end(), start_s); point != times.end() && *point < end_s;
         ++point) {
        const double rate = input.profile_rate_deg_h[static_cast<std::size_t>(point - times.begin())];
        angle += 0.5 * (from_rate + rate) * (*point - from_s);
        from_s = *point;
        from_rate = rate;
    }
    return angle + 0.5 * (from_rate + profile_rate_deg_h(input, end_s)) * (end_s - from_s);
}

double amplitude_change_relative(const Dither& dither, double duration_s) {
    return 6.0 * dither.amplitude_wander_relative_rt_s * std::sqrt(duration_s) +
           std::abs(dither.amplitude_drift_relative_per_h) * duration_s / 3600.0;
}

bool asks(const Specification& specification) {
    return specification.arw_deg_rt_h > 0.0 || specification.bias_stability_deg_h > 0.0 ||
           specification.rate_error_deg_h > 0.0 || specification.scale_factor_error_ppm > 0.0 ||
           specification.angle_error_arcsec > 0.0;
}

}  // namespace ringlock::scenario
