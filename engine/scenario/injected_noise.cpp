#include "engine/scenario/injected_noise.hpp"

#include <numbers>

#include "engine/gyro/theory.hpp"
#include "engine/scenario/active_effects.hpp"

namespace ringlock::scenario {

gyro::DriveNoise drive_noise(const Scenario& scenario) {
    const NoiseInjection& noise = scenario.noise_injection;
    return {.frequency_hz = scenario.dither.frequency_hz,
            .resonator_q = noise.resonator_q,
            .form = noise.form,
            .distribution = noise.distribution,
            .hold_half_cycles = noise.hold_half_cycles,
            .modulation_hz = noise.modulation_hz,
            .amplitude_loop_hz = noise.amplitude_loop_hz};
}

InjectedNoise injected_noise(const Scenario& scenario) {
    constexpr double sigmas_of_tables = 8.0;
    const NoiseInjection& noise = scenario.noise_injection;
    InjectedNoise injected;
    injected.turn_rms_rad = noise.turn_phase_rms_rad;
    if (noise.model == NoiseModel::turns) {
        // A half cycle's amplitude is half the difference of two turns' angles.
        injected.amplitude_rms_rad = injected.turn_rms_rad / std::numbers::sqrt2;
        injected.margin_rad = sigmas_of_tables * injected.amplitude_rms_rad;
        return injected;
    }
    const gyro::Resonator resonator(drive_noise(scenario));
    if (noise.drive_noise_relative > 0.0) {
        const double swing_rad = gyro::modulation_depth_rad(configured_setup(scenario));
        injected.turn_rms_rad = noise.drive_noise_relative * swing_rad * resonator.rms();
    }
    injected.amplitude_rms_rad = injected.turn_rms_rad;
    injected.margin_rad = sigmas_of_tables * injected.turn_rms_rad;
    if (noise.form != gyro::NoiseForm::white) {
        injected.change_rms_rad = injected.turn_rms_rad * resonator.change_per_half_cycle();
        injected.change_rad = sigmas_of_tables * injected.change_rms_rad;
    }
    return injected;
}

}  // namespace ringlock::scenario
