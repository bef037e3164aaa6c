#pragma once
#include <vector>

#include "analysis/closure/decide/view.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/fit/fit.hpp"

namespace ringlock::closure {

/// Number of harmonics of the turn's phase in residual tests.
inline constexpr int harmonics_of_phase = options.turns.residual.harmonics;

using TurnView = View<Regressor>;

/// Evidence of the regression: gain of the log-likelihood with the noise fitted again and the coefficients integrated
/// out, less its search; minus infinity if a coefficient is larger than makes sense.
/// \param rival  evidence with which it is compared
double refitted_merit(const TurnFit& fit, const TurnView& view, double rival);

/// Tests the innovations that count against all quantities of the record: phase at the turns and its harmonics,
/// direction, amplitude, temperature, input rate, time, frequency, and earlier innovations. The tests keep a reference
/// to the fit.
std::vector<TurnView> view_residual(const TurnFit& fit);

}  // namespace ringlock::closure
