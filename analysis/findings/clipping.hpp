#pragma once
#include <span>
#include <string>

#include "analysis/allan/sums/phase.hpp"
#include "analysis/findings/finding.hpp"

namespace ringlock::findings {

/// Share of the variance of normal data that is lost where those above `limit` standard deviations are set to it.
double share_clipped_off(double limit);

/// Why clipped data forbid noise coefficients, or nothing: where the noise that they hide would make the coefficients
/// too small by more than a quarter of the least error that so many data leave, 1/sqrt(2 n). The ends of the range are
/// compared with the median and the median deviation of the data, which clipping does not change; ends that are far
/// beyond the noise clip spikes and not the noise. Accumulated angles have no such distribution: any that are clipped
/// forbid coefficients.
/// \param found   of which those that are clipped matter
/// \param values  the data, NaN where missing or left out as repeated
std::string why_clipping_withholds(std::span<const Finding> found, allan::Kind kind, std::span<const double> values);

}  // namespace ringlock::findings
