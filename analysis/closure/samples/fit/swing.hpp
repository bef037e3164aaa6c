#pragma once
#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// A variance that goes up and down at a frequency.
struct Swing {
    double cos = 0.0, sin = 0.0;  ///< of its logarithm
    double gain = 0.0;            ///< of the log-likelihood
};

/// Of the innovations that count: fitted by Newton's method.
Swing swing_of_variance(const SampleFit& fit, double hz);

/// The model with errors of readings whose variance goes up and down in that way; the noise is fitted again. An
/// innovation contains the errors of earlier readings as well, and shows less of it.
SampleFit with_swinging_errors(const SampleFit& fit, double hz, const Swing& seen);

}  // namespace ringlock::closure
