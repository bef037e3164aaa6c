#pragma once
#include "analysis/noise/model/spectrum.hpp"

namespace ringlock::noise {

/// Whether nothing but a line and a ramp is in the coefficients, above the rounding of the angles themselves.
///
/// \param largest_rate_unit  largest absolute angle over tau0, unit of the rate
bool only_rounding(const Spectrum& s, double largest_rate_unit);

}  // namespace ringlock::noise
