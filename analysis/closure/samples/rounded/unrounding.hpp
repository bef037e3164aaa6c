#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"

/// Readings in steps that are not small against their noise. Their rounding is not an independent noise: it follows the
/// angle.
namespace ringlock::closure {

/// Increments as they were measured, whole multiples of a step.
struct RoundedIncrements {
    std::span<const double> arcsec;
    double step_arcsec;
    /// Number of Kalman filters, 256 at most. Log-likelihoods that are compared need the same number.
    std::size_t filters;
};

/// Number of filters that resolves the moments at which the angle crosses a step, given that noise: the rarer, the
/// more.
std::size_t filters_for(double step_arcsec, double sd_arcsec);

/// Imputes increments before rounding, by a mixture of Kalman filters (Chen and Liu, J. R. Stat. Soc. B 62, 493, 2000).
/// Each filter draws every reading from its prediction, within the step that was recorded; the filters are resampled by
/// the probabilities that they gave to the step. One path through them is returned. If the model is true it is
/// distributed as the increments before rounding.
std::vector<double> impute(const SampleFit& fit, const RoundedIncrements& rounded, std::uint64_t seed);

/// Distribution of each rounded increment, predicted by the same filters from the increments before it.
struct Prediction {
    std::vector<double> mean, variance, fourth_moment, log_probability;
};
Prediction predict_rounded(const SampleFit& fit, const RoundedIncrements& rounded);

/// Log-likelihood of the rounded increments up to row `until`, over rows that count in the fit. It has a random error
/// of some units, which is nearly the same for models near each other: a difference of ten has an error of a few
/// tenths, and of up to two where steps are sixty times the noise.
double log_likelihood_of_rounded(const SampleFit& fit, const RoundedIncrements& rounded, std::size_t until);

/// Whether steps are so large that their rounding follows the angle, by the first harmonic of the rounding: noise of
/// that standard deviation reduces it to exp(-2 pi^2 sd^2/step^2) (Widrow and Kollar, "Quantization Noise", 2008,
/// chapter 5).
bool rounding_shows(double step_arcsec, double sd_arcsec);

}  // namespace ringlock::closure
