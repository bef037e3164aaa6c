#pragma once
#include <vector>

#include "analysis/closure/decide/view.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/fit/fit.hpp"

namespace ringlock::closure {

/// Of the turn's phase, that views of the residual look at.
inline constexpr int harmonics_of_phase = options.turns.residual.harmonics;

using TurnView = View<Regressor>;

/// Gain of the log-likelihood by the regression, the noise fitted anew beside it and its coefficients integrated out,
/// less its search; minus infinity where coefficients make no sense. `rival`: the merit that it is compared with.
double refitted_merit(const TurnFit& fit, const TurnView& view, double rival);

/// Holds the innovations that count against everything that the record has: phase at the turns and its harmonics,
/// direction, amplitude, temperature, input rate, time, frequency, the innovations before. The views refer to the fit.
std::vector<TurnView> view_residual(const TurnFit& fit);

}  // namespace ringlock::closure
