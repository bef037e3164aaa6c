#pragma once
#include <optional>

#include "engine/dither/phase_chain.hpp"

namespace ringlock::dither {

/// Mean and long-term variance of the kicks by the transfer operator of the chain: Poisson's equation, solved by GMRES,
/// with as many harmonics of the phase as the result takes to stand to 0.5 % of the random walk. Nothing where that
/// takes more than some seconds.
std::optional<KickDrift> operator_drift(const PhaseChain& chain);

}  // namespace ringlock::dither
