#pragma once
#include <string>
#include <vector>

#include "analysis/report/plot.hpp"
#include "analysis/stability/density.hpp"
#include "app/allan/series.hpp"

namespace ringlock::app {

/// How a spectral density is estimated and written (--psd-method, --psd-sides).
struct DensityChoice {
    bool cosine = false;     ///< the spectrum of the noise fit; else Welch's
    bool one_sided = false;  ///< twice the two-sided density
};

/// Throws InputError.
DensityChoice density_choice(const std::string& method, const std::string& sides);

/// The density of one series, of the rate in the unit of the deviations.
struct SeriesDensity {
    std::vector<stability::DensityPoint> points;  ///< of the sides that were asked for
    std::vector<double> model;                    ///< of the fitted noise at the same frequencies; empty without a fit
    std::size_t segment = 0;                      ///< of Welch's estimate, in samples
};

/// Throws InputError where the series is too short, or none of its parts without gaps is long enough.
SeriesDensity density_of(const AllanRequest& request, const AnalysedSeries& series, const DensityChoice& choice);

/// file, column, frequency_hz, the density and that of the model with sides and unit in their names, count, method.
std::string density_csv(const std::vector<AllanOutput>& series, const std::vector<SeriesDensity>& densities,
                        const DensityChoice& choice);

report::Figure density_figure(const std::vector<AllanOutput>& series, const std::vector<SeriesDensity>& densities,
                              const DensityChoice& choice);

}  // namespace ringlock::app
