#pragma once
#include "analysis/closure/turns/fit/fit.hpp"

namespace ringlock::closure {

/// Whether the residual of turns is as large at every phase of theirs, by two harmonics at minima and at maxima. Of
/// normal innovations.
ResidualTest size_over_phase(const TurnFit& fit);

}  // namespace ringlock::closure
