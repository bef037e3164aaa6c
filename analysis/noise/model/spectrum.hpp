#pragma once
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "analysis/noise/model/shapes.hpp"

namespace ringlock::noise {

struct LostInformation;

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
    Shapes shape{};                       ///< the spectral shapes that depend on no other parameter
    double sin2 = 0.0;                    ///< sin^2(pi x), for that of a correlated rate
};

/// A record of rates as orthonormal cosine coefficients (DCT-II) without the constant one.
struct Spectrum {
    std::vector<double> z;  ///< coefficients 1...n-1 (z[0] belongs to frequency 1/(2 n tau0)), unit of the rate
    std::vector<Bin> bins;
    std::size_t samples = 0;  ///< rates used: the longest length with small prime factors, at most 2 % fewer
    /// Of a record with missing samples, whose z are expectations: their variances given the samples that are there,
    /// which are added to the powers; and what is not known of the parameters, if it has been computed.
    std::vector<double> spread;
    std::shared_ptr<const LostInformation> lost;

    void sum_bins();                     ///< anew, after a change of z
    double corner(std::size_t j) const;  ///< u of coefficient j >= 1
    double ramp(std::size_t j) const;    ///< d of coefficient j >= 1; 0 for even j
    double x(std::size_t j) const { return 0.5 * static_cast<double>(j) / static_cast<double>(samples); }
};

/// \param rate  consecutive mean rates, any unit, any offset; at least 8
Spectrum cosine_spectrum(std::span<const double> rate);

}  // namespace ringlock::noise
