#pragma once
#include <cstddef>
#include <functional>
#include <span>

#include "analysis/closure/samples/model/states.hpp"

namespace ringlock::closure {

/// What a filter does with a reading, whatever it is.
struct SampleGains {
    int ticks;                     ///< source intervals from the row before
    double share;                  ///< resampled: from the source's reading before to that after
    double variance;               ///< of the innovation
    std::span<const double> gain;  ///< a state each
};

/// Row after row, to where they stay the same.
void filter_gains(const SampleStates& filter, std::size_t rows, const std::function<void(const SampleGains&)>& take);

constexpr std::size_t most_lanes = 8;

/// What each filter makes of a row: innovations and their variances, one a lane.
using TakeLanes = std::function<void(std::size_t row, const double* innovations, const double* variances)>;

/// Kalman filters beside one another, at most `most_lanes` and all alike (SampleStates::is_like), each fed with the
/// same increments; compiled for each instruction set.
void filter_lanes(std::span<const SampleStates> filters, std::span<const double> increments, const TakeLanes& take);

}  // namespace ringlock::closure
