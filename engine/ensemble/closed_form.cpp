#include "engine/ensemble/closed_form.hpp"

#include <algorithm>
#include <string>

#include "engine/effects/effect.hpp"
#include "engine/gyro/device.hpp"
#include "engine/propagate/rotation.hpp"

namespace ringlock::ensemble {

bool drive_repeats(const scenario::Scenario& scenario) {
    if (scenario::has_profile(scenario.input) || scenario.dither.amplitude_wander_relative_rt_s != 0.0 ||
        scenario.dither.amplitude_drift_relative_per_h != 0.0) {
        return false;
    }
    const auto all = effects::registry();
    return std::none_of(all.begin(), all.end(), [&](const effects::Effect* effect) {
        const auto values = scenario.effects.find(std::string(effect->name()));
        // The effect itself is asked, so that a new one cannot be forgotten here.
        return values != scenario.effects.end() && effect->active(values->second) &&
               (effect->adds_angle() || effect->rate_process(values->second, {scenario.ensemble.seed, 0}) != nullptr ||
                (scenario::temperature_varies(scenario.environment) &&
                 effect->threshold_factor(values->second, 1.0) != 1.0));
    });
}

std::optional<double> closed_form_rate_error_deg_h(const gyro::Setup& setup) {
    const gyro::Device device(setup);
    if (!propagate::has_exact_cycle(device)) return std::nullopt;
    return propagate::mean_rate_error_deg_h(propagate::exact_cycle(device), device);
}

}  // namespace ringlock::ensemble
