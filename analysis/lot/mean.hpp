#pragma once
#include <cstdint>
#include <optional>
#include <span>

#include "analysis/lot/confidence.hpp"

namespace ringlock::lot {

/// A mean over a lot, in the values' unit.
struct Mean {
    std::optional<double> value;               ///< absent where no gyro has a value that can be averaged
    std::optional<double> standard_deviation;  ///< of the gyros, n - 1 degrees of freedom; absent where n < 2
    std::optional<double> half_width;          ///< of the interval; absent where n < 2
    std::optional<Interval> interval;          ///< of the population's mean; absent where n < 2
    std::int64_t n = 0;                        ///< gyros averaged
    std::int64_t left_out = 0;                 ///< gyros whose value is NaN or infinite
};

/// Arithmetic mean with Student's t interval (Biometrika 6, 1, 1908): mean +- t s/sqrt(n) widening(), t the quantile
/// (1 + level)/2 of n - 1 degrees of freedom. Exact for normal values in a lot of fixed size. Equal values have an
/// interval of no width: they show no scatter.
///
/// \param values  one a gyro; NaN: this gyro has none
/// Throws InputError where the level is not in (0, 1).
Mean mean(std::span<const double> values, const Confidence& confidence = {});

/// A geometric mean over a lot.
struct GeometricMean {
    std::optional<double> value;                   ///< exp of the mean of the logarithms, in the values' unit
    std::optional<double> log_standard_deviation;  ///< of the logarithms
    std::optional<Interval> interval;              ///< of the population's geometric mean
    std::optional<double> relative_half_width;     ///< upper end over the mean less 1, the longer side
    std::int64_t n = 0;
    std::int64_t left_out = 0;  ///< gyros whose value is NaN, infinite, zero or negative
};

/// Geometric mean: exp() of the mean of the logarithms and of the ends of its t interval, which is exact for lognormal
/// values. Random walks of a lot scatter by factors, and the logarithm makes that symmetric.
///
/// \param values  one a gyro; NaN: this gyro has none
/// Throws InputError where the level is not in (0, 1).
GeometricMean geometric_mean(std::span<const double> values, const Confidence& confidence = {});

}  // namespace ringlock::lot
