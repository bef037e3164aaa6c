#pragma once
#include <array>
#include <cstddef>

/// Noise coefficients of a gyro from a record of its angle. docs/dev/allan-coefficients.md derives them.
namespace ringlock::noise {

/// The noises whose variances are fitted; the rate ramp and sinusoids, means and no variances, are treated apart.
enum Term : std::size_t {
    quantisation = 0,
    angle_random_walk = 1,
    flicker = 2,
    rate_random_walk = 3,
    correlated = 4,  ///< exponentially correlated (first-order Markov) rate
};
inline constexpr std::size_t term_count = 5;
/// Shapes at x = f tau0 of the terms before `correlated`, whose shape depends on its correlation time.
using Shapes = std::array<double, correlated>;

/// Spectral shapes at x = f tau0, in 0 < x < 1/2, two-sided, divided by tau0: the variance of a cosine coefficient of
/// the rate is sum_i theta_i shape_i(x) with theta = {Q^2/tau0^2, N^2/tau0, B^2, K^2 tau0}.
///
/// The rate is the mean of a continuous process over each interval, so flicker and random walk are summed over all
/// aliases. `index` > 0 is the number of the cosine, from which the finite length of the record corrects the flicker;
/// 0: no such correction.
Shapes shapes(double x, double index = 0.0);

/// The same of the exponentially correlated rate of variance 1, of a correlation time T and a record of n samples.
///
/// Means over tau0 of a rate with covariance exp(-|t|/T) are an ARMA(1, 1) process. With a = tau0/T, s = sin(pi x) and
/// S = sinh^2(a/2) its aliased spectrum is (2/a^2) (a S - s^2 (sinh a - a))/(S + s^2). What a cosine reaches beyond
/// the ends of the record takes off 4 S^2 (1 - s^2)/(n a^2 (S + s^2)^2), but for exp(-n a).
class CorrelatedShape {
   public:
    /// \param log_correlation_time  ln(T/tau0), T/tau0 from 1/2 to n/10
    CorrelatedShape(double log_correlation_time, std::size_t samples);
    struct Value {
        double shape = 0.0;
        double slope = 0.0;  ///< by ln T
    };
    /// \param sin2  sin^2(pi x)
    Value operator()(double sin2) const;

   private:
    double a_, sinh_half2_, sinh_, sinh_less_a_, samples_;
};

/// Correlation times that a record of n samples can show, ln(T/tau0): the corner 1/(2 pi T) lies between the third
/// coefficient of the spectrum and the largest.
inline constexpr double shortest_correlation_samples = 0.5;
inline constexpr double correlations_in_record = 10.0;
struct LogTimes {
    double lo = 0.0;
    double hi = 0.0;
};
LogTimes log_times(std::size_t samples);

}  // namespace ringlock::noise
