#pragma once
#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// How well a model foretells the rows that are only reported.
struct SampleScore {
    double error = 0.0;           ///< rms of one-step predictions [arcsec]
    double log_score = 0.0;       ///< sum of the logarithms of their densities
    double floor = 0.0;           ///< what the model says that the error is [arcsec]
    double log_likelihood = 0.0;  ///< of the rows that choose
};

/// \param lattice_arcsec  of the values: with one the prediction is a distribution on it
SampleScore score_of(const SampleFit& fit, const Rows& reported, double lattice_arcsec);

}  // namespace ringlock::closure
