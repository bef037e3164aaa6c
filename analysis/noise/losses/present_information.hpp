#pragma once
#include <cstddef>
#include <span>

#include "analysis/noise/losses/conditional.hpp"
#include "analysis/noise/model/lost_information.hpp"
#include "analysis/noise/model/spectrum.hpp"

namespace ringlock::noise {

/// Fisher information on the parameters that the rates that are there have, and that of a record without gaps.
///
/// With y of covariance C, the covariance of what is there, w = C^-1 y and t_k = (dC/dtheta_k) w, the expectation of
/// t_k^T C^-1 t_l/2 is tr(C^-1 dC_k C^-1 dC_l)/2. One y drawn from the model tells it to about 1/sqrt(n) for terms that
/// rest on all of a record. The same y without gaps tells the information of a record without gaps: what the low
/// frequencies have by chance is in both, and goes out in their ratio.
/// \param spectrum  of the record; its bins have the shapes
/// \param model     whose parameters
/// \param noise     of the coefficients under that model
/// \param pairs     of draws
LostInformation present_information(const Spectrum& spectrum, const Maximum& model, const CoefficientNoise& noise,
                                    std::span<const Gap> gaps, std::size_t pairs);

}  // namespace ringlock::noise
