#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "analysis/lot/confidence.hpp"

namespace ringlock::lot {

/// Which of the sorted values, counted from 1, bound a quantile of the population; absent where the lot is too small.
struct QuantileRanks {
    std::optional<std::int64_t> lo;
    std::optional<std::int64_t> hi;
};

/// Ranks of the tightest interval of order statistics with equal tails (H. A. David, H. N. Nagaraja, Order Statistics,
/// 3rd ed. 2003, section 7.1). With B = binomial(n, p) values below the quantile, the lo-th value lies above it where B
/// < lo, the hi-th below it where B >= hi: lo is the largest rank, hi the smallest, for which that has at most
/// tail_probability(). Exact for any continuous population, on the safe side where values can be equal.
///
/// \param n  values, 0 or more
/// \param p  in (0, 1)
/// Throws InputError where n, p or the level is outside.
QuantileRanks quantile_ranks(std::int64_t n, double p, const Confidence& confidence = {});

/// A quantile of those gyros that have a value.
struct Quantile {
    double p = 0.5;
    std::optional<double> value;  ///< absent where no gyro has a value, or between -infinity and infinity
    std::optional<double> lo;     ///< absent where the lot is too small to bound it
    std::optional<double> hi;
    std::int64_t n = 0;        ///< gyros with a value
    std::int64_t missing = 0;  ///< gyros without: they belong to no quantile, and a report must mention them
};

/// Quantiles with intervals of order statistics.
///
/// The estimate is definition 8 of R. J. Hyndman, Y. Fan (American Statistician 50, 361, 1996), linear between the
/// sorted values at position (n + 1/3) p + 1/3, which is nearly unbiased in the median for any population; they
/// recommend it. Definition 7 (position (n - 1) p + 1) lies too far inside where p is near 0 or 1. Beyond the first and
/// the last value it is that value, and then one end of the interval is absent.
///
/// \param values  one a gyro, in any order and unit; NaN: this gyro has none. Infinities are values like others
/// \param p       in (0, 1) each
/// \return one a p, in their order
/// Throws InputError where p or the level is outside.
std::vector<Quantile> quantiles(std::span<const double> values, std::span<const double> p,
                                const Confidence& confidence = {});

}  // namespace ringlock::lot
