#pragma once
#include <vector>

#include "analysis/findings/search.hpp"

namespace ringlock::findings {

/// Stretches of a white series whose variance is another than that of all the rest, the least probable first, at most
/// five. Windows of 2^k data at every half of their length are compared; the spread of squares is that of the series
/// itself, so that digits and heavy tails are no stretches.
std::vector<Finding> stretches_of_other_variance(const std::vector<double>& white, const SearchOptions& options);

}  // namespace ringlock::findings
