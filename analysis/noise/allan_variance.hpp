#pragma once
#include <string>
#include <vector>

#include "analysis/noise/fit.hpp"

namespace ringlock::noise {

/// What one term of a fit contributes to the Allan variance.
struct VarianceTerm {
    std::string name;               ///< "N", "B", ...
    std::vector<double> variances;  ///< (deg/h)^2, one for each averaging time
};

/// The terms that a record supports, as IEEE Std 952 writes them: 3 Q^2/tau^2, N^2/tau, (2 ln 2/pi) B^2, K^2 tau/3,
/// R^2 tau^2/2; correlated noise (q_c T_c)^2/tau (1 - T_c/(2 tau) (3 - 4 exp(-tau/T_c) + exp(-2 tau/T_c))); sinusoids
/// Omega_0^2 sin^4(pi f_0 tau)/(pi f_0 tau)^2.
///
/// \param fit    described coefficients; those that are not resolved have no term
/// \param tau_s  averaging times [s], > 0
std::vector<VarianceTerm> variance_terms(const NoiseFit& fit, const std::vector<double>& tau_s);

}  // namespace ringlock::noise
