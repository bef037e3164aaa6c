#include "engine/scenario/injected_noise.hpp"

#include <numbers>
#include <optional>
#include <tuple>
#include <utility>

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

namespace {

/// Figures of a resonator that take long to compute where its noise has a long memory.
struct Spread {
    double rms;
    double change_per_half_cycle;
    double decay;
};

auto key_of(const gyro::DriveNoise& noise) {
    return std::make_tuple(noise.frequency_hz, noise.resonator_q, noise.form, noise.distribution,
                           noise.hold_half_cycles, noise.modulation_hz, noise.amplitude_loop_hz);
}

/// Several rules need this for one scenario: each thread keeps its last result.
Spread spread_of(const gyro::DriveNoise& noise) {
    thread_local std::optional<std::pair<decltype(key_of(noise)), Spread>> last;
    if (!last || last->first != key_of(noise)) {
        const gyro::Resonator resonator(noise);
        const bool changes = noise.form != gyro::NoiseForm::white;
        last.emplace(key_of(noise),
                     Spread{resonator.rms(), changes ? resonator.change_per_half_cycle() : 0.0, resonator.decay()});
    }
    return last->second;
}

}  // namespace

bool amplitude_loop_is_stable(const Scenario& scenario) {
    return scenario.noise_injection.model != NoiseModel::drive || spread_of(drive_noise(scenario)).decay < 1.0;
}

InjectedNoise injected_noise(const Scenario& scenario) {
    constexpr double sigmas_of_tables = 8.0;
    constexpr double least_noise_rad = 1e-100;
    const NoiseInjection& noise = scenario.noise_injection;
    InjectedNoise injected;
    injected.turn_rms_rad = noise.turn_phase_rms_rad;
    if (noise.model == NoiseModel::turns) {
        // A half cycle's amplitude is half the difference of two turns' angles.
        injected.amplitude_rms_rad = injected.turn_rms_rad / std::numbers::sqrt2;
        injected.margin_rad = sigmas_of_tables * injected.amplitude_rms_rad;
        return injected;
    }
    const Spread spread = spread_of(drive_noise(scenario));
    if (noise.drive_noise_relative > 0.0) {
        const double swing_rad = gyro::modulation_depth_rad(configured_setup(scenario));
        injected.turn_rms_rad = noise.drive_noise_relative * swing_rad * spread.rms;
    }
    // Noise that is so small that its square underflows is taken as zero.
    if (injected.turn_rms_rad < least_noise_rad) injected.turn_rms_rad = 0.0;
    injected.amplitude_rms_rad = injected.turn_rms_rad;
    injected.margin_rad = sigmas_of_tables * injected.turn_rms_rad;
    injected.change_rms_rad = injected.turn_rms_rad * spread.change_per_half_cycle;
    injected.change_rad = sigmas_of_tables * injected.change_rms_rad;
    return injected;
}

}  // namespace ringlock::scenario
