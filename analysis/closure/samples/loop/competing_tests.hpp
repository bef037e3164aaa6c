#pragma once
#include <optional>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/types.hpp"

namespace ringlock::closure {

/// A residual test as a competitor of effects: the gain by its own regression, with the noise fitted again.
struct CompetingTest {
    double evidence = 0.0;  ///< gain of the log-likelihood less its cost [nats]
    double trends = 0.0;    ///< number of its columns that are trends in time
    Where where = Where::time;
    bool jumps = false;
    bool repeats = false;                    ///< a variance that oscillates
    std::optional<double> hz = {};           ///< of a line
    std::optional<double> by_variance = {};  ///< evidence of a scattered line, by the variance that it explains
    double of_a_motion = 0.0;                ///< evidence against a motion, which has resonances of its own
    std::optional<double> of_states = {};    ///< evidence of jumps whose times are summed over
};

/// The residual tests with the largest evidence.
/// \param lattice_arcsec  quantisation of the values
/// \param resampled       whether the record may be resampled: a variance that oscillates is then fitted as well
/// \param moved           whether the case may have moved: power that scatters about a line is then fitted as well
std::vector<CompetingTest> competing_tests_of(const SampleFit& fit, double lattice_arcsec, bool resampled, bool moved);

}  // namespace ringlock::closure
