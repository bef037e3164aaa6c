#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "analysis/lot/confidence.hpp"

namespace ringlock::lot {

/// A figure of two arms that are compared gyro by gyro.
struct PairedFigure {
    std::optional<double> value;       ///< absent where there is no pair
    std::optional<Interval> interval;  ///< absent where there are fewer than 2 pairs
    /// The interval excludes the value of equal arms (ratio 1, difference 0), and the value differs from that by more
    /// than the rounding of the values.
    bool distinguishable = false;
    std::int64_t pairs = 0;
    std::int64_t left_out = 0;  ///< gyros that make no pair
};

/// Geometric mean of a/b over the gyros, with the t interval of the mean of log(a/b) (see geometric_mean). The
/// contributions that both arms of a gyro share cancel, so that the interval is as narrow as the arms' own scatter
/// allows. A gyro makes no pair where either value is NaN, infinite, zero or negative.
///
/// \param a,b  one value a gyro, the same gyro at the same place
/// Throws InputError where the lengths differ or the level is not in (0, 1).
PairedFigure paired_ratio(std::span<const double> a, std::span<const double> b, const Confidence& confidence = {});

/// Mean of a - b over the gyros with its t interval. Values may have either sign; a gyro makes no pair where either is
/// NaN or infinite, or their difference is.
///
/// \param a,b  one value a gyro, the same gyro at the same place
/// Throws InputError where the lengths differ or the level is not in (0, 1).
PairedFigure paired_difference(std::span<const double> a, std::span<const double> b, const Confidence& confidence = {});

/// Ratio and difference of two arms over the same pairs.
struct Comparison {
    PairedFigure ratio;       ///< a/b
    PairedFigure difference;  ///< a - b
};

/// Both figures of positive values, as random walks are: a gyro makes no pair for either where a value is NaN,
/// infinite, zero or negative.
///
/// \param a,b  one value a gyro, the same gyro at the same place
/// Throws InputError where the lengths differ or the level is not in (0, 1).
Comparison compare(std::span<const double> a, std::span<const double> b, const Confidence& confidence = {});

/// Every arm against every other.
class ComparisonMatrix {
   public:
    /// \param arms  one row an arm, one value a gyro; the same gyro at the same place of every row
    /// Throws InputError where the lengths differ or the level is not in (0, 1).
    explicit ComparisonMatrix(std::span<const std::vector<double>> arms, const Confidence& confidence = {});

    std::size_t arms() const { return arms_; }
    /// Arm a over, and less, arm b; (b, a) is the exact counterpart. Each interval holds with its level by itself: of
    /// the k (k - 1)/2 pairs of k arms that are equal, one in twenty is distinguishable at 0.95.
    /// Throws InputError where there is no such arm.
    const Comparison& at(std::size_t a, std::size_t b) const;

   private:
    std::size_t arms_ = 0;
    std::vector<Comparison> cells_;
};

}  // namespace ringlock::lot
