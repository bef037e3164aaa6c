#pragma once
#include <cstdint>

#include "engine/scenario/scenario.hpp"

namespace ringlock::test::closure {

/// A gyro with nothing beyond the base model, for records of so many turns.
inline scenario::Scenario plain_gyro(double turns, std::uint64_t seed) {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.ensemble.gyros = 1;
    scenario.ensemble.seed = seed;
    scenario.ensemble.dither_asymmetry_sd_ratio = 0.0;
    scenario.ensemble.dither_amplitude_sd_relative = 0.0;
    scenario.ensemble.duration_s = 0.5 * turns / scenario.dither.frequency_hz;
    return scenario;
}

/// So much noise is injected at the turns, or none.
inline void inject(scenario::Scenario& scenario, double noise_rad) {
    if (noise_rad > 0.0) {
        scenario.noise_injection.turn_phase_rms_rad = noise_rad;
    } else {
        scenario.record.trajectory = scenario::parse_arm("uncompensated");
    }
}

/// Such a gyro, with so much noise or none.
inline scenario::Scenario gyro(double turns, std::uint64_t seed, double injected_rad) {
    scenario::Scenario scenario = plain_gyro(turns, seed);
    inject(scenario, injected_rad);
    return scenario;
}

}  // namespace ringlock::test::closure
