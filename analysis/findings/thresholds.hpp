#pragma once
#include <cstddef>

#include "analysis/findings/events.hpp"

namespace ringlock::findings {

/// Deviate whose absolute value a normal one exceeds with probability `level` in any of n trials.
double normal_threshold(double level, std::size_t n);

/// A place and by how much its absolute deviate exceeds a threshold; an excess of 0 where none does.
struct Best {
    std::size_t at = 0;
    double excess = 0.0;
};

/// The largest excess over `least` among the places from <= t < to.
Best best_of(const Scan& found, double least, std::size_t from, std::size_t to);

}  // namespace ringlock::findings
