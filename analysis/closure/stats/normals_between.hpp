#pragma once
#include <span>

namespace ringlock::closure {

/// Standard normal numbers between two bounds, many at once: how probable they are, and those below which a share of
/// that lies. Relative errors of probabilities are below 1e-11 but where the bounds are closer than that allows; of
/// numbers, absolute, below 1e-10.
///
/// \param low    the lower bound of each [standard deviations]
/// \param width  to the upper bound, the same for all
/// \param share  of each, from 0 to 1
/// \param probability, number  as many
void normals_between(std::span<const double> low, double width, std::span<const double> share,
                     std::span<double> probability, std::span<double> number);

}  // namespace ringlock::closure
