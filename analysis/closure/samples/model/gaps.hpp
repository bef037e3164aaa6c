#pragma once
#include <cstddef>
#include <vector>

#include "analysis/closure/types.hpp"

namespace ringlock::closure {

/// Puts values on straight lines between their neighbours in the place of those that are missing (NaN), before the
/// first and after the last the nearest value. Does nothing where all are missing.
/// \return how many were missing
std::size_t bridge_gaps(std::vector<double>& values);

/// Puts the mean of the values around a gap in the place of increments that are missing (NaN).
/// \return how many were missing
std::size_t fill_gaps(std::vector<double>& increments);

/// Rows that no fit and no test may count, since the filter has to find the state of the gyro again: those that are
/// missing and up to options.samples.record.rows_behind_gap behind each gap, fewer where a record with many gaps would
/// lose more than half of its rows.
/// \param missing  1 for each row that is
Rows rows_about_gaps(const Rows& missing);

}  // namespace ringlock::closure
