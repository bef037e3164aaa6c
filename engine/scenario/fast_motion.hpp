#pragma once
#include "engine/scenario/scenario.hpp"

namespace ringlock::scenario {

/// Whether every half cycle that the scenario's arms may need from the turn map has a fast middle
/// (gyro/fast_motion.hpp): over the spread of the gyros, injected noise, rates and thresholds that vary, and the room
/// that tables leave for them.
bool fast_middles(const Scenario& scenario);

/// Largest change of a gyro's phase between a turn of the dither and the phase's own turn, where the rate of dither and
/// input vanishes [rad]; a phase for the steps of the readout on that way, which are limited in time as well, is added.
double way_to_turns_rad(const Scenario& scenario);

/// Whether the phase of every gyro, from a turn at any input rate to the middle of the half cycle, passes the quarter
/// fringes whose pulses are timed.
bool pulses_before_middles(const Scenario& scenario);

/// Whether the polynomials of the turn map can hold propagation.turn_map_tolerance_rad over the amplitudes and rates
/// that a table of the scenario must cover; estimated from the phase of the zero-rate point, without making one. Tables
/// without fast middles do not count.
bool tables_hold_the_tolerance(const Scenario& scenario);

}  // namespace ringlock::scenario
