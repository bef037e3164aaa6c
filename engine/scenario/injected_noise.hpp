#pragma once
#include "engine/gyro/resonator.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::scenario {

/// Figures of the dither's amplitude under the noise that a scenario injects, in optical phase.
struct InjectedNoise {
    double turn_rms_rad = 0.0;       ///< rms of the angle at a turn
    double amplitude_rms_rad = 0.0;  ///< rms of a half cycle's amplitude
    double margin_rad = 0.0;         ///< eight standard deviations of the amplitude that tables are made for
    double change_rms_rad = 0.0;     ///< rms change of the amplitude over a half cycle; 0: half cycles are cosines
    double change_rad = 0.0;         ///< eight of its change over a half cycle; 0: half cycles are cosines
};
InjectedNoise injected_noise(const Scenario& scenario);

/// Whether the amplitude loop of a drive is stable; true without one.
bool amplitude_loop_is_stable(const Scenario& scenario);

/// The resonator of [noise_injection] with model = "drive".
gyro::DriveNoise drive_noise(const Scenario& scenario);

}  // namespace ringlock::scenario
