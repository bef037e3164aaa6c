#pragma once
#include <vector>

#include "analysis/allan/sums/phase.hpp"
#include "analysis/allan_run/outcome.hpp"

namespace ringlock::allan_run {

/// Searches the data for faults that no noise model has, and estimates the noise without those, of all data or, where a
/// record with gaps is too long for that, of the longest part without gaps: outliers and jumps are taken off by their
/// estimated sizes, wraps are undone. The findings join those that are in `out`.
/// \param values   the data, NaN where missing
/// \param scale    one of the data in arcsec (m/s, s), or in arcsec/s of rates
void search_and_fit(std::vector<double> values, const allan::Phase& phase, allan::Kind kind, double scale,
                    AllanOutput& out);

}  // namespace ringlock::allan_run
