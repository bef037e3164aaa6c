#pragma once
#include "engine/gyro/half_cycle.hpp"

/// Where the phase of a half cycle runs fast: its rate is large beside the coupling and changes little in a fringe.
/// There the turn map takes it for a plain rotation (docs/turn-map.md), and needs it so from some time on up to the
/// middle.
namespace ringlock::gyro {

/// Upper bound of the phase acceleration of the drive.
double greatest_acceleration_rad_s2(const HalfCycle& half);

/// Time from the turn, up to the middle of the half cycle, from which motion is fast. NaN where it never is.
/// `half.sign` must be +1.
double fast_motion_from_s(const HalfCycle& half, double b_rad_s);

/// Whether the turn map exists: enough fringes between the turn and the middle, and coupling that is weak beside the
/// rate there.
bool has_fast_middle(const HalfCycle& half, double b_rad_s);

/// The coupling strength to ask for where the fast motion is a series of harmonics: the factor 2 leaves it room for
/// these.
double strength_with_harmonics_rad_s(const Coupling& coupling);

}  // namespace ringlock::gyro
