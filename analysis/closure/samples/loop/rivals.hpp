#pragma once
#include <optional>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/types.hpp"

namespace ringlock::closure {

/// A residual test as a rival of effects: how much its own regression explains, with the noise fitted again.
struct Rival {
    double merit = 0.0;    ///< gain of the log-likelihood less its cost [nats]
    double courses = 0.0;  ///< number of its columns that are trends in time of any size
    Where where = Where::time;
    bool jumps = false;
    bool repeats = false;                    ///< a variance that repeats
    std::optional<double> hz = {};           ///< of a line
    std::optional<double> by_variance = {};  ///< merit of a line whose power is scattered, by the variance it takes off
    double of_a_motion = 0.0;                ///< merit against a motion, which has resonances of its own
    std::optional<double> of_states = {};    ///< merit of jumps whose course is integrated out
};

/// The residual tests that explain most.
/// \param lattice_arcsec  steps of the values
/// \param resampled       the record may be resampled: a variance that repeats is fitted as well
/// \param moved           the case may have moved: power that scatters about a line is fitted as well
std::vector<Rival> rivals_of(const SampleFit& fit, double lattice_arcsec, bool resampled, bool moved);

}  // namespace ringlock::closure
