#pragma once
#include <cstddef>
#include <functional>
#include <span>

#include "analysis/closure/sample_states.hpp"

namespace ringlock::closure {

constexpr std::size_t most_lanes = 8;

/// What each filter makes of a row: innovations and their variances, one a lane.
using TakeLanes = std::function<void(std::size_t row, const double* innovations, const double* variances)>;

/// Kalman filters beside one another, at most `most_lanes` and all alike (SampleStates::is_like), each fed with the
/// same increments; compiled for each instruction set.
void filter_lanes(std::span<const SampleStates> filters, std::span<const double> increments, const TakeLanes& take);

}  // namespace ringlock::closure
