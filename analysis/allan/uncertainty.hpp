#pragma once
#include <cstdint>

#include "analysis/allan/estimator.hpp"

namespace ringlock::allan {

/// Divisor of the mean of an estimate of variance, so that it is the Allan (modified Allan, Hadamard) variance: the
/// published corrections of the total family, 1 for all others.
///
/// \param alpha   power-law exponent of the noise
/// \param m       averaging factor
/// \param points  phase points of the record
///
/// Total: 1 - a tau/T, a = 1/(3 ln 2) for flicker, 3/4 for random walk. Modified and time total: 0.94, 0.83, 0.73,
/// 0.70, 0.69 for alpha = 2 ... -2. Hadamard total, from m = 2 on: 1 - 0.005, 0.149, 0.229, 0.283, 0.321 for alpha = 0
/// ... -4. NIST SP1065 sections 5.2.11 to 5.2.14.
double published_bias(Estimator estimator, int alpha, std::int64_t m, std::int64_t points);

/// Distribution of an estimate for one kind of noise.
struct Uncertainty {
    double edf = 0.0;   ///< equivalent degrees of freedom
    double bias = 1.0;  ///< mean of the uncorrected variance over the truth
    double low = 1.0;   ///< quantiles of the variance over its mean at (1 -+ confidence)/2
    double high = 1.0;
};

/// Uncertainty of one point of a curve.
///
/// \param points      phase points of the record; with gaps, of one without that has as many terms
/// \param confidence  two-sided, in (0, 1)
///
/// From sixteen degrees of freedom on an estimate is taken as chi-squared; below, the distribution is that of the
/// estimator's own quadratic form (distribution_of), on a record of the same length in tau with eight samples to a tau,
/// wherever the statistics do not depend on the sampling. The total family has no sums over lags: the degrees of its
/// plain counterpart (degrees_of_freedom) are multiplied by the ratio between the two quadratic forms, on records of at
/// most sixteen tau (for the total deviation it decreases in proportion to tau/T beyond), and bias follows from the
/// forms with four and eight samples to a tau. Results for a short record are kept for the next record of its kind.
/// Thread-safe.
Uncertainty uncertainty_of(Estimator estimator, int alpha, std::int64_t m, std::int64_t points, double confidence);

}  // namespace ringlock::allan
