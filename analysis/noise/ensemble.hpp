#pragma once
#include <cstdint>
#include <span>

namespace ringlock::noise {

/// A figure over an ensemble with its range.
struct Range {
    double median = 0.0;
    double lo = 0.0;
    double hi = 0.0;
};

/// Quantile by linear interpolation between order statistics (the value at position p (n-1) of the sorted ones).
///
/// \param values  finite, at least one, any order
/// \param p       0...1
double quantile(std::span<const double> values, double p);

/// Median and the range that holds the central 68.27 % of the values.
Range central_range(std::span<const double> values);

/// Percentile bootstrap of the median (Efron 1979).
///
/// \param values  finite, at least one
/// \param level   two-sided confidence, in (0, 1)
/// \param seed    of the resampling; the same seed gives the same interval
/// \param rounds  resamplings
/// Throws InputError where values is empty, one is not finite or the level is outside (0, 1).
Range bootstrap_median_interval(std::span<const double> values, double level, std::uint64_t seed, int rounds = 2000);

}  // namespace ringlock::noise
