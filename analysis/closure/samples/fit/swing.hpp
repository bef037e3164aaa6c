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

/// The model in which it is the readings' errors whose variance does, the noise fitted anew. An innovation has the
/// errors of the readings before as well, and shows less.
SampleFit with_swinging_errors(const SampleFit& fit, double hz, const Swing& seen);

}  // namespace ringlock::closure
