#include "engine/ensemble/closed_form.hpp"

#include <algorithm>

#include "engine/gyro/device.hpp"
#include "engine/propagate/rotation.hpp"
#include "engine/scenario/active_effects.hpp"

namespace ringlock::ensemble {

bool drive_repeats(const scenario::Scenario& scenario) {
    if (scenario::has_profile(scenario.input) || scenario.dither.amplitude_wander_relative_rt_s != 0.0 ||
        scenario.dither.amplitude_drift_relative_per_h != 0.0) {
        return false;
    }
    const auto active = scenario::active_effects(scenario);
    const effects::Exposure exposed = scenario::exposure(scenario);
    return std::none_of(active.begin(), active.end(), [&](const scenario::ActiveEffect& one) {
        const auto& [effect, values] = one;
        const effects::Bounds bounds = effect->bounds(*values, exposed);
        return effect->adds_angle() || bounds.threshold_relative != 0.0 || bounds.coupling_phase_rad != 0.0 ||
               effect->rate_process(*values, {scenario.ensemble.seed, 0}) != nullptr;
    });
}

std::optional<double> closed_form_rate_error_deg_h(const gyro::Setup& setup) {
    const gyro::Device device(setup);
    if (!propagate::has_exact_cycle(device)) return std::nullopt;
    return propagate::mean_rate_error_deg_h(propagate::exact_cycle(device), device);
}

}  // namespace ringlock::ensemble
