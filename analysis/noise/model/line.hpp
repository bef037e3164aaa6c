#pragma once
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "analysis/noise/model/likelihood.hpp"

namespace ringlock::noise {

/// Variances of all cosine coefficients under a model: of each bin's middle, interpolated on logarithmic scales.
std::vector<double> coefficient_variances(const Spectrum& spectrum, const Maximum& model);

/// Coefficients less the means of a model: its ramp and its end errors.
std::vector<double> residual(const Spectrum& spectrum, const Maximum& model);

/// A sinusoid among the rates, a cos(2 pi x t) + b sin(2 pi x t) with t in samples from the middle of the record.
struct Line {
    double index = 0.0;  ///< 2 n x: the number of the cosine coefficient where it stands, between whole ones
    double cosine = 0.0;
    double sine = 0.0;
    std::array<std::array<double, 3>, 3> covariance{};  ///< of cosine, sine, index
    double gain = 0.0;                                  ///< what it lowers the deviance by, variances held

    double amplitude() const;
    double amplitude_variance() const;
};

/// Sinusoids in cosine coefficients with independent errors of known variance.
///
/// About the middle of the record a cosine has even coefficients only and a sine odd ones: with theta = 2 pi x,
/// beta = n theta/2 and phi = pi j/n they are (8/n)^(1/2) sin(theta/2) cos(phi/2)/(cos phi - cos theta) times sin beta
/// and cos beta.
class LineFinder {
   public:
    explicit LineFinder(std::size_t samples);

    /// The place, to a quarter of a coefficient, where a sinusoid lowers the deviance most; by what is within a few
    /// coefficients. Not where fewer than four periods are in the record, nor within four coefficients of a line that
    /// is taken.
    std::optional<Line> strongest(std::span<const double> residual, std::span<const double> variance,
                                  std::span<const Line> taken) const;
    /// Amplitudes and frequency by least squares (Gauss and Newton), from a frequency within half a coefficient.
    void refine(Line& line, std::span<const double> residual, std::span<const double> variance) const;
    /// Adds `times` the line to coefficients.
    void add(const Line& line, double times, std::span<double> z) const;

   private:
    template <class Visit>
    void columns(double index, const Visit& visit) const;

    std::size_t samples_;
    std::vector<double> cos_half_, sin_half2_;  ///< cos(phi/2) and sin^2(phi/2)
};

/// What the largest of all sinusoids must lower the deviance by: passed by chance with this probability.
///
/// Of a continuous frequency over a record with even samples P(max > 2 z) is n (pi/12)^(1/2) exp(-z) z^(1/2)
/// (R. Baluev, Mon. Not. R. Astron. Soc. 385 (2008) 1279, eq. (6), with the variance n^2/12 of the instants).
double line_price(std::size_t samples, double significance);

}  // namespace ringlock::noise
