#pragma once
#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// How well a model predicts the held-out rows.
struct SampleScore {
    double error = 0.0;           ///< rms of one-step predictions [arcsec]
    double log_score = 0.0;       ///< sum of the logarithms of their densities
    double floor = 0.0;           ///< rms error that the model predicts [arcsec]
    double log_likelihood = 0.0;  ///< of the training rows
};

/// \param reported  the held-out rows
/// \param lattice_arcsec  step of the values: the prediction is then a distribution over its multiples
SampleScore score_of(const SampleFit& fit, const Rows& reported, double lattice_arcsec);

}  // namespace ringlock::closure
