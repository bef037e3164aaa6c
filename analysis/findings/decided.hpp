#pragma once
#include <vector>

#include "analysis/findings/clean_fit.hpp"

namespace ringlock::findings {

/// Withholds the coefficients that the search does not leave: the random walk where a jump explains the record as well,
/// all of them where a stretch has another variance or the search was given up.
/// \param rate  of the record without its events, those that are missing filled in
void decide(const std::vector<double>& rate, const SearchOptions& options, CleanFit& out);

}  // namespace ringlock::findings
