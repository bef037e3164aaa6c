#pragma once
#include <limits>

#include "engine/gyro/half_cycle.hpp"

/// The phase at any instant between two turns, without integrating the fringes in between.
namespace ringlock::propagate {

/// A half cycle that a gyro has gone through, and the phase that the lock-in had added at three places of it.
struct PassedHalfCycle {
    gyro::HalfCycle half;
    gyro::Coupling coupling;            ///< over this half cycle
    double plain_start_fringes = 0.0;   ///< phase of drive and input at the first turn, less any whole fringes
    double lockin_start_fringes = 0.0;  ///< phase that the lock-in had added up to the first turn
    double lockin_end_fringes = 0.0;    ///< the same up to the second turn
    /// The same up to the middle, in the frame in which fast motion is rotation, as the turn map has it. NaN where it
    /// is not known: the equation is then integrated from the nearer turn through every fringe.
    double lockin_middle_fringes = std::numeric_limits<double>::quiet_NaN();
};

/// Phase that the lock-in had added `t_s` after the first turn [fringes]; 0 <= t_s <= half.duration_s.
///
/// Within some ten fringes of the nearer turn the equation of motion is integrated from there. Farther away the motion
/// is a rotation in the frame of fast_frame.hpp, and its state in the middle gives it everywhere. The error is below
/// 1e-8 rad, and below 1e-9 rad for the gyros of `ringlock devices`; docs/dev/turn-map.md, "Between turns".
double lockin_between_turns_fringes(const PassedHalfCycle& passed, double t_s);

}  // namespace ringlock::propagate
