#include "engine/scenario/scenario.hpp"

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
    return environment.temperature_ramp_k_per_h != 0.0 || environment.temperature_swing_k != 0.0;
}

double temperature_change_k(const Environment& environment, double time_s) {
    const double phase = 2.0 * std::numbers::pi * std::fmod(time_s / environment.temperature_period_s, 1.0);
    return environment.temperature_ramp_k_per_h * time_s / 3600.0 + environment.temperature_swing_k * std::sin(phase);
}

double input_rate_deg_h(const InputRate& input, std::int64_t point) {
    if (point == 0) return input.rate_deg_h;
    if (point == input.sweep_points - 1) return input.sweep_stop_deg_h;
    const double fraction = static_cast<double>(point) / static_cast<double>(input.sweep_points - 1);
    return input.rate_deg_h + fraction * (input.sweep_stop_deg_h - input.rate_deg_h);
}

}  // namespace ringlock::scenario
