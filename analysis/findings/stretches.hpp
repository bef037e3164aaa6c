#pragma once
#include <vector>

#include "analysis/findings/search.hpp"

namespace ringlock::findings {

/// Stretches of a white series whose variance is another than that of all the rest, the least probable first, at most
/// five. Windows of 2^k data at every half of their length are compared; the spread of squares is that of the series
/// itself, so that digits and heavy tails are no stretches.
std::vector<Finding> stretches_of_other_variance(const std::vector<double>& white, const SearchOptions& options);

/// Stretches that are so much noisier than most of a white series that no event in them means anything: windows in
/// which the median of the squares is larger than the usual one by options.disturbed_ratio. Medians, so that single
/// outliers make no stretch. Windows that follow each other are one stretch.
std::vector<Finding> disturbed_stretches(const std::vector<double>& white, const SearchOptions& options);

}  // namespace ringlock::findings
