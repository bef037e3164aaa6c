#pragma once
#include <cstdint>
#include <vector>

#include "analysis/allan/estimator.hpp"

namespace ringlock::allan {

/// A sum of squares of independent standard normal deviates with positive weights: the distribution of any of the
/// variances, exactly.
class WeightedSquares {
   public:
    /// Squares of one weight, and how many: not necessarily a whole number.
    struct Share {
        double weight = 0.0;
        double count = 1.0;
    };

    /// \param shares  weights > 0; at least one
    explicit WeightedSquares(std::vector<Share> shares);

    double mean() const { return mean_; }
    /// Degrees of freedom of the chi-squared of equal mean and variance.
    double degrees() const { return degrees_; }
    /// Value over the mean that is not exceeded with this probability, in (0, 1).
    ///
    /// From the saddle point of the cumulant function (R. Lugannani, S. Rice, Adv. Appl. Prob. 12 (1980) 475); the
    /// probability is off by less than 0.005, for a single weight, which is the worst case.
    double quantile(double probability) const;

   private:
    double probability_below(double x) const;

    std::vector<Share> shares_;  ///< of sum 1
    double mean_ = 0.0;
    double degrees_ = 0.0;
};

/// Distribution of a variance (before its bias is corrected) over the variance that a record without end would have.
///
/// \param estimator  one with an interval
/// \param alpha      power-law exponent of the noise, alpha + 2 differences > 1
/// \param m          averaging factor
/// \param points     phase points, at least span_of(estimator, m); cost goes with their third power
///
/// The estimate is x^T B x of the phase x. With B = R^T R the weights are the eigenvalues of R C R^T, C the generalised
/// covariance of the phase: rows of R are differences, for which it is a covariance. mean() is the bias.
WeightedSquares distribution_of(Estimator estimator, int alpha, std::int64_t m, std::int64_t points);

}  // namespace ringlock::allan
