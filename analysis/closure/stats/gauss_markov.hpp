#pragma once
#include <cmath>

namespace ringlock::closure {

/// One step of a first-order Gauss-Markov rate of unit variance, and of its integral, the angle: rate' = decay rate +
/// u, angle' = angle + gain_s rate + v, with u and v normal. For a rate of variance s^2 the variances and the
/// covariance are s^2 times these.
struct GaussMarkovStep {
    double decay = 1.0;
    double gain_s = 0.0;
    double rate_variance = 0.0;      ///< of u
    double covariance_s = 0.0;       ///< of u and v
    double angle_variance_s2 = 0.0;  ///< of v

    GaussMarkovStep(double time_s, double interval_s) {
        const double x = interval_s / time_s;
        const double e = std::expm1(-x);
        decay = 1.0 + e;
        gain_s = -e * time_s;
        rate_variance = -std::expm1(-2.0 * x);
        covariance_s = time_s * e * e;
        // 2 x - 3 + 4 exp(-x) - exp(-2 x) = x^3 2/3 - x^4/2 + ...; the closed form loses the digits of the series.
        const double variance =
            x < 0.02 ? x * x * x * (2.0 / 3.0 - x * (0.5 - x * (7.0 / 30.0 - x / 12.0))) : 2.0 * x + 2.0 * e - e * e;
        angle_variance_s2 = time_s * time_s * variance;
    }
};

}  // namespace ringlock::closure
