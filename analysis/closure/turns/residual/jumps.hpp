#pragma once
#include <cstddef>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/two_levels.hpp"
#include "analysis/closure/turns/fit/fit.hpp"

/// A rate that jumps between two levels, in the residual of a fit of turns.
namespace ringlock::closure {

/// Two levels in stretches of the record, under the noise of the fit.
TwoLevels levels_of_stretches(const TurnFit& fit, std::size_t stretches = options.turns.jumps.stretches);

/// The angle of such a rate: the integral of one at one level and zero at the other [s]. Jumps at the ends of stretches
/// are moved to the times at which they explain most under the noise of the fit.
std::vector<double> placed_jumps(const TurnFit& fit, const TwoLevels& levels);

/// Evidence of jumps under the noise that remains with them in the model. If jumps were most of the noise, short stays
/// show only then. This is searched only if jumps come near the evidence `competing` at first: of a true random rate
/// they explain far less, and there are many.
double evidence_of_jumps(const TurnFit& fit, const TwoLevels& levels, double competing);

}  // namespace ringlock::closure
