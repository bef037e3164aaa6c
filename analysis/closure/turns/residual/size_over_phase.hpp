#pragma once
#include "analysis/closure/turns/fit/fit.hpp"

namespace ringlock::closure {

/// Tests whether the residual of turns has the same size at every phase, by two harmonics at minima and at maxima. The
/// innovations must be normal.
ResidualTest size_over_phase(const TurnFit& fit);

}  // namespace ringlock::closure
