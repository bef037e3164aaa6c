#pragma once
#include <cstdint>
#include <vector>

#include "analysis/closure/sample_fit.hpp"

/// Readings in steps that are not small beside their noise. Their rounding is no noise of its own: it follows the
/// angle.
namespace ringlock::closure {

/// What increments may have been before they were rounded, drawn: by a mixture of Kalman filters (Chen and Liu, J. R.
/// Stat. Soc. B 62, 493, 2000). Each draws every reading from what it foretells within the step that was recorded, and
/// they are drawn anew by how probable they made it. The increments are one path through them: where the model is true
/// they are as probable as those that were rounded.
/// \param rounded  increments, whole multiples of `step_arcsec` [arcsec]
std::vector<double> unround(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec,
                            std::uint64_t seed);

/// Of each rounded increment, by those before it, as the same filters foretell it.
struct Foretold {
    std::vector<double> mean, variance, fourth_moment, log_probability;
};
Foretold foretell_rounded(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec);

/// Log-likelihood of the rounded increments up to that row, of those that count in the fit.
double log_likelihood_of_rounded(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec,
                                 std::size_t until);

/// Whether steps are so large that their rounding shows the angle: the first harmonic of the rounding, of which noise
/// of that standard deviation leaves exp(-2 pi^2 sd^2/step^2) (Widrow and Kollar, "Quantization Noise", 2008, chapter
/// 5).
bool rounding_shows(double step_arcsec, double sd_arcsec);

}  // namespace ringlock::closure
