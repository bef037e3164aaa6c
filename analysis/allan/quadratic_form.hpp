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
    /// From the inversion of the moment generating function M, P(Q > x) = int M(s) e^{-sx}/s ds/(2 pi i), along a
    /// parabola through its saddle point that bends as the path of steepest descent of equal weights does, with the
    /// weight that a fifth of the sum does not exceed: trapezoids converge at once there, however few the weights, and
    /// a few large ones do not bend it to where the others grow. Good to 1e-6.
    double quantile(double probability) const;

   private:
    /// Derivatives of the cumulant function ln M(t) = -1/2 sum ln(1 - 2 w t).
    struct Cumulants {
        double first = 0.0;
        double second = 0.0;
    };
    Cumulants cumulants(double t) const;
    double saddle_point(double x) const;
    double probability_below(double x) const;

    std::vector<Share> shares_;  ///< of sum 1, ascending
    double mean_ = 0.0;
    double degrees_ = 0.0;
    double common_weight_ = 0.0;
};

/// Distribution of a variance (before its bias is corrected) over the variance that a record without end would have.
///
/// \param estimator  one with an interval
/// \param alpha      power-law exponent of the noise, alpha + 2 differences > 1
/// \param m          averaging factor
/// \param points     phase points, at least span_of(estimator, m); cost is proportional to their third power
///
/// The estimate is x^T B x of the phase x. With B = R^T R the weights are the eigenvalues of R C R^T, C the generalised
/// covariance of the phase: rows of R are differences, for which it is a covariance. mean() is the bias.
WeightedSquares distribution_of(Estimator estimator, int alpha, std::int64_t m, std::int64_t points);

}  // namespace ringlock::allan
