#pragma once
#include <span>

namespace ringlock::closure {

/// Truncated standard normal distributions, many at once: the probability between two bounds, and the number below
/// which a given share of that probability lies. Relative errors of probabilities are below 1e-11 unless the bounds are
/// too close for that; absolute errors of numbers are below 1e-10.
///
/// \param low    the lower bound of each [standard deviations]
/// \param width  distance to the upper bound, the same for all
/// \param share  share of the probability below the number, of each, from 0 to 1
/// \param probability, number  results, of the same length
void normals_between(std::span<const double> low, double width, std::span<const double> share,
                     std::span<double> probability, std::span<double> number);

}  // namespace ringlock::closure
