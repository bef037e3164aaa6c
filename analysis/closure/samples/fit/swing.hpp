#pragma once
#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// A variance that oscillates at a frequency.
struct Swing {
    double cos = 0.0, sin = 0.0;  ///< coefficients of its logarithm
    double gain = 0.0;            ///< of the log-likelihood
};

/// Oscillation of the variance of the innovations that count, fitted by Newton's method.
Swing swing_of_variance(const SampleFit& fit, double hz);

/// The model with errors of readings whose variance oscillates in that way; the noise is fitted again. An innovation
/// also contains the errors of earlier readings, so that the oscillation of its variance is smaller.
SampleFit with_swinging_errors(const SampleFit& fit, double hz, const Swing& seen);

}  // namespace ringlock::closure
