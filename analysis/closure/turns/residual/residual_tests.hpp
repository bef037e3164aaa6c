#pragma once
#include <vector>

#include "analysis/closure/decide/residual_test.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/fit/fit.hpp"

namespace ringlock::closure {

/// Number of harmonics of the turn's phase in residual tests.
inline constexpr int harmonics_of_phase = options.turns.residual.harmonics;

using TurnResidualTest = ResidualTestOn<Regressor>;

/// Evidence of the regression: gain of the log-likelihood with the noise fitted again and the coefficients integrated
/// out, less its search; minus infinity if a coefficient is larger than makes sense.
/// \param competing  evidence with which it is compared
double refitted_evidence(const TurnFit& fit, const TurnResidualTest& test, double competing);

/// Tests the innovations that count against all quantities of the record: phase at the turns and its harmonics,
/// direction, amplitude, temperature, input rate, time, frequency, and earlier innovations. The tests keep a reference
/// to the fit.
std::vector<TurnResidualTest> test_residual(const TurnFit& fit);

}  // namespace ringlock::closure
