#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/allan/sums/phase.hpp"

namespace ringlock::allan {

/// Phase with the line that phase_of() removed added again: time interval errors are computed from it.
std::vector<double> with_line(const Phase& phase);

/// A maximum, and of how many windows.
struct Largest {
    double range = 0.0;
    std::int64_t windows = 0;
};

/// Maximum time interval error at each step: the largest spread max - min within any m + 1 neighbouring points (NIST
/// SP1065 section 5.2.17). Missing points are left out of a window; windows without a known point do not count.
///
/// \param x  phase as measured; NaN where missing
/// \param m  steps
std::vector<Largest> maximum_interval_errors(std::span<const double> x, std::span<const std::int64_t> m);

}  // namespace ringlock::allan
