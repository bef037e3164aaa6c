#pragma once
#include <cstddef>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/two_levels.hpp"
#include "analysis/closure/turns/fit/fit.hpp"

/// A rate that jumps to and fro between two levels, in what a fit of turns has left.
namespace ringlock::closure {

/// Two levels in stretches of the record, under the noise of the fit.
TwoLevels levels_of_stretches(const TurnFit& fit, std::size_t stretches = options.turns.jumps.stretches);

/// The angle of such a rate, with jumps of stretches moved to where they explain most under the noise of the fit: one
/// at one level, zero at the other [s].
std::vector<double> placed_jumps(const TurnFit& fit, const TwoLevels& levels);

/// The merit of jumps under the noise that they leave: where they are most of it, short stays are not seen before.
/// Searched only where jumps come near `rival` to begin with: a rate that wanders leaves them far behind, and has many.
double merit_of_jumps(const TurnFit& fit, const TwoLevels& levels, double rival);

}  // namespace ringlock::closure
