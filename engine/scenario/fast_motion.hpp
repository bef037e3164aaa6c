#pragma once
#include "engine/scenario/scenario.hpp"

namespace ringlock::scenario {

/// Whether every half cycle that the scenario's arms may ask of the turn map has a fast middle (gyro/fast_motion.hpp):
/// over the spread of the gyros, injected noise, rates and thresholds that vary, and the room that tables leave for
/// them.
bool fast_middles(const Scenario& scenario);

}  // namespace ringlock::scenario
