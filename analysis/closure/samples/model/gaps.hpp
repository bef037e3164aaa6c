#pragma once
#include <cstddef>
#include <vector>

#include "analysis/closure/types.hpp"

namespace ringlock::closure {

/// Replaces missing values (NaN) by the straight line between the adjacent values; before the first and after the last
/// value, by that value. Does nothing if all values are missing.
/// \return number of missing values
std::size_t bridge_gaps(std::vector<double>& values);

/// Replaces missing increments (NaN) by the mean of up to options.samples.record.rows_around_gap increments on either
/// side of the gap.
/// \return number of missing increments
std::size_t fill_gaps(std::vector<double>& increments);

/// Rows that no fit and no test counts: missing rows, and up to options.samples.record.rows_behind_gap rows behind each
/// gap, in which the filter finds the state of the gyro again. The number behind each gap is halved until at most half
/// of all rows are excluded.
/// \param missing  1 for each missing row
Rows rows_about_gaps(const Rows& missing);

}  // namespace ringlock::closure
