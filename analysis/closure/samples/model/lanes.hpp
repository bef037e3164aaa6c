#pragma once
#include <cstddef>
#include <functional>
#include <span>

#include "analysis/closure/samples/model/states.hpp"

namespace ringlock::closure {

/// Update of a filter by one row, which does not depend on the value of the reading.
struct SampleGains {
    int ticks;  ///< source intervals since the row before
    /// Resampled: place between two readings of the source, 0 at the first, 1 at the second.
    double share;
    double variance;               ///< of the innovation
    std::span<const double> gain;  ///< one per state
};

/// Calls `take` with the gains of each row, up to the row from which they stay the same.
void filter_gains(const SampleStates& filter, std::size_t rows, const std::function<void(const SampleGains&)>& take);

constexpr std::size_t most_lanes = 8;

/// Receives the innovations and their variances of one row, one per lane.
using TakeLanes = std::function<void(std::size_t row, const double* innovations, const double* variances)>;

/// Runs at most `most_lanes` Kalman filters of the same structure (SampleStates::is_like) next to each other in vector
/// lanes, each on the same increments. Compiled for each instruction set. Throws std::logic_error if the filters differ
/// in structure or are too many.
void filter_lanes(std::span<const SampleStates> filters, std::span<const double> increments, const TakeLanes& take);

}  // namespace ringlock::closure
