#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "analysis/noise/fit.hpp"

/// Further analyses of series: spectral densities, deviations over time windows, differences of three.
namespace ringlock::stability {

/// Spectral density of a rate at one frequency.
struct DensityPoint {
    double frequency_hz = 0.0;
    double density = 0.0;   ///< two-sided: the variance is its integral from -1/(2 tau0) to 1/(2 tau0); unit^2/Hz
    std::size_t count = 0;  ///< segments (Welch) or cosine coefficients (cosine_density) in the mean
};

/// Welch's mean of modified periodograms: Hann window, segments that overlap by half, the mean of each taken off.
///
/// \param rate     consecutive mean rates, NaN where missing; segments with a missing value are left out
/// \param tau0_s   sampling interval [s], > 0
/// \param segment  values in a segment, at least 8
/// \return frequencies k/(segment tau0), k = 1...segment/2; nothing where no segment is whole
///
/// P. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70. The density of a segment is tau0 |sum w_i r_i exp(-2 pi i k
/// i/segment)|^2/sum w_i^2.
std::vector<DensityPoint> welch_density(std::span<const double> rate, double tau0_s, std::size_t segment);

/// The segment that is taken where none is asked for: a power of two, an eighth of the record at most, 8 at least.
std::size_t welch_segment(std::size_t samples);

/// The spectrum that the noise coefficients are fitted to: tau0 times the mean square of neighbouring cosine
/// coefficients (noise::cosine_spectrum), from 1/(2 n tau0) on.
///
/// \param rate  at least 8 rates, none missing
std::vector<DensityPoint> cosine_density(std::span<const double> rate, double tau0_s);

/// Two-sided density of the rates, means over tau0, that the fitted terms give at each frequency in 0 < f < 1/(2 tau0);
/// sinusoids and a ramp, which have no density, are not in it. Units of a NoiseFit: (deg/h)^2/Hz of a gyro.
std::vector<double> model_density(const noise::NoiseFit& fit, double tau0_s, std::span<const double> frequencies_hz);

}  // namespace ringlock::stability
