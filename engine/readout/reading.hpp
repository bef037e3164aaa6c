#pragma once
#include <cstdint>

namespace ringlock::readout {

/// What the electronics report of one zero-rate point: a row of /turns of an rlg-record.
struct Reading {
    double time_s = 0.0;
    int direction = 1;               ///< +1 at a phase minimum, -1 at a maximum
    std::int64_t quarter_count = 0;  ///< up/down count of quarter fringes: floor(phase/(pi/2))
    double sin = 0.0;                ///< quadrature detectors at the zero-rate point
    double cos = 1.0;
    double accel_before_rad_s2 = 0.0;  ///< magnitude of the phase acceleration from the two nearest quarter-fringe
    double accel_after_rad_s2 = 0.0;   ///< pulses on that side; 0 where none was seen
};

}  // namespace ringlock::readout
