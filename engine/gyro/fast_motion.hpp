#pragma once
#include "engine/gyro/half_cycle.hpp"

/// Where the phase of a half cycle runs fast: its rate is large compared with the coupling and changes little in a
/// fringe. There the turn map takes it for a plain rotation (docs/dev/turn-map.md). Where motion is nowhere fast enough
/// to do so without error the rotation begins in the middle, where the map needs it only as a smooth choice of
/// coordinates.
namespace ringlock::gyro {

/// Time at which the rate of drive and input vanishes next to the turn at the beginning; a harmonic of the dither
/// counts by its rate at the turn.
double zero_rate_s(const HalfCycle& half);

/// Upper bound of the phase acceleration of the drive.
double greatest_acceleration_rad_s2(const HalfCycle& half);

/// Time from the turn, up to the middle of the half cycle, from which motion is fast; the middle where it is nowhere
/// fast. NaN where has_fast_middle() is false. `half.sign` must be +1.
double fast_motion_from_s(const HalfCycle& half, double b_rad_s);

/// Whether the turn map exists: the phase goes through at least 10 rad from its zero-rate point to the middle (3.2
/// fringes in a half cycle of a sinusoid without input), and its rate there is at least four times the coupling.
bool has_fast_middle(const HalfCycle& half, double b_rad_s);

/// The coupling strength that fast motion is tested for where it is a series of harmonics: the factor 2 leaves room for
/// these.
double strength_with_harmonics_rad_s(const Coupling& coupling);

}  // namespace ringlock::gyro
