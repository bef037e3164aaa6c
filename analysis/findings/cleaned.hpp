#pragma once
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "analysis/allan/sums/phase.hpp"
#include "analysis/findings/finding.hpp"

namespace ringlock::findings {

/// How many data a cleaned series is without.
struct Cleaned {
    std::size_t left_out = 0;   ///< data that are missing now: of stretches of another variance, or that repeat a value
    std::size_t corrected = 0;  ///< outliers, each less its estimated size
    std::size_t jumps = 0;      ///< steps taken off all data behind them
};

/// Takes the findings from the data: outliers and jumps by their estimated sizes, stretches of another variance and
/// values that repeat the one before them by making these data missing (NaN). Wraps and clipped values stay.
/// \param findings  rows and sizes of the data themselves; jumps of the rate of a phase in its unit a second
/// \param values    the data, NaN where missing; changed in place
Cleaned clean(std::span<const Finding> findings, allan::Kind kind, double tau0_s, std::span<double> values);

/// What a cleaned series is without, as "all data" or "the data without 2 outliers, 1 jump and 99 data of disturbed
/// stretches or of runs of one value".
std::string data_of(const Cleaned& cleaned);

}  // namespace ringlock::findings
