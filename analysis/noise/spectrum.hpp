#pragma once
#include <array>
#include <span>
#include <vector>

/// Noise coefficients of a gyro from a record of its angle. docs/allan.md derives what stands here.
namespace ringlock::noise {

/// The four noises whose variances are fitted; the rate ramp, a mean and no variance, is treated apart.
enum Term : std::size_t { quantisation = 0, angle_random_walk = 1, flicker = 2, rate_random_walk = 3 };
inline constexpr std::size_t term_count = 4;
using TermValues = std::array<double, term_count>;

/// Spectral shapes of the four terms at x = f tau0, in 0 < x < 1/2, two-sided, divided by tau0: the variance of a
/// cosine coefficient of the rate is sum_i theta_i shape_i(x) with theta = {Q^2/tau0^2, N^2/tau0, B^2, K^2 tau0}.
///
/// The rate is the mean of a continuous process over each interval, so flicker and random walk are summed over all
/// aliases. `index` > 0 is the number of the cosine, from which the finite length of the record corrects the flicker;
/// 0: no such correction.
TermValues shapes(double x, double index = 0.0);

/// Sums over neighbouring cosine coefficients across which the model's variance hardly changes; all the likelihood
/// needs. Index 0 of pairs: even coefficients, 1: odd.
struct Bin {
    double count = 0.0;
    double x = 0.0;                   ///< mean of f tau0
    double power = 0.0;               ///< sum of z^2
    std::array<double, 2> corner2{};  ///< sum of u^2, u: coefficient of the unmatched angle error at the record's ends
    std::array<double, 2> corner_data{};  ///< sum of u z
    double ramp2 = 0.0;                   ///< sum of d^2, d: coefficient of a ramp of one unit a sample (odd only)
    double ramp_data = 0.0;               ///< sum of d z
    double ramp_corner = 0.0;             ///< sum of d u
    TermValues shape{};                   ///< the four spectral shapes
};

/// A record of rates as orthonormal cosine coefficients (DCT-II) without the constant one.
struct Spectrum {
    std::vector<double> z;  ///< coefficients 1...n-1 (z[0] belongs to frequency 1/(2 n tau0)), unit of the rate
    std::vector<Bin> bins;
    std::size_t samples = 0;  ///< rates used: the longest length with small prime factors, at most 2 % fewer

    double corner(std::size_t j) const;  ///< u of coefficient j >= 1
    double ramp(std::size_t j) const;    ///< d of coefficient j >= 1; 0 for even j
    double x(std::size_t j) const { return 0.5 * static_cast<double>(j) / static_cast<double>(samples); }
};

/// \param rate  consecutive mean rates, any unit, any offset; at least 8
Spectrum cosine_spectrum(std::span<const double> rate);

}  // namespace ringlock::noise
