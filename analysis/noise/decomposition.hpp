#pragma once
#include <vector>

#include "analysis/noise/model/line.hpp"
#include "analysis/noise/model/markov.hpp"

namespace ringlock::noise {

/// A record parted into sinusoids and noise.
struct Decomposition {
    Spectrum noise;           ///< without the sinusoids
    std::vector<Line> lines;  ///< those that the terms of noise cannot take the place of
    std::vector<double>
        evidence;  ///< of each line: by how much it lowered the deviance when it was found, all else free
    Maximum five;  ///< maximum of the five terms
    Markov markov;
};

/// \param significance  of the test for one more sinusoid over all frequencies, and of that for correlated noise
///
/// Sinusoids are found one after the other as long as the next one is significant with all variances fitted anew, at
/// most three. A line also moves the variances, and these weigh it: both are repeated until the deviance stays.
Decomposition decompose(Spectrum spectrum, double significance);

}  // namespace ringlock::noise
