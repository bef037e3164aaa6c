#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"

/// Readings in steps that are not small beside their noise. Their rounding is no noise of its own: it follows the
/// angle.
namespace ringlock::closure {

/// Increments as they were measured, whole multiples of a step.
struct RoundedIncrements {
    std::span<const double> arcsec;
    double step_arcsec;
    /// How many Kalman filters go through them, 256 at most. Log-likelihoods that are compared want as many.
    std::size_t filters;
};

/// As many as hit the moments at which the angle crosses a step beside that noise: the rarer, the more.
std::size_t filters_for(double step_arcsec, double sd_arcsec);

/// What increments may have been before they were rounded, drawn: by a mixture of Kalman filters (Chen and Liu, J. R.
/// Stat. Soc. B 62, 493, 2000). Each draws every reading from what it foretells within the step that was recorded, and
/// they are drawn anew by how probable they made it. The increments are one path through them: where the model is true
/// they are as probable as those that were rounded.
std::vector<double> unround(const SampleFit& fit, const RoundedIncrements& rounded, std::uint64_t seed);

/// Of each rounded increment, by those before it, as the same filters foretell it.
struct Foretold {
    std::vector<double> mean, variance, fourth_moment, log_probability;
};
Foretold foretell_rounded(const SampleFit& fit, const RoundedIncrements& rounded);

/// Log-likelihood of the rounded increments up to that row, of those that count in the fit. By chance it is off by
/// some units, but for models near each other nearly by the same: a difference of ten by a few tenths, up to two where
/// steps are sixty times the noise.
double log_likelihood_of_rounded(const SampleFit& fit, const RoundedIncrements& rounded, std::size_t until);

/// Whether steps are so large that their rounding shows the angle: the first harmonic of the rounding, of which noise
/// of that standard deviation leaves exp(-2 pi^2 sd^2/step^2) (Widrow and Kollar, "Quantization Noise", 2008, chapter
/// 5).
bool rounding_shows(double step_arcsec, double sd_arcsec);

}  // namespace ringlock::closure
