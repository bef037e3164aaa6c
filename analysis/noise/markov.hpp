#pragma once
#include "analysis/noise/subsets.hpp"

namespace ringlock::noise {

/// Exponentially correlated noise beside the five terms, at its likeliest correlation time.
struct Markov {
    bool supported = false;  ///< the five terms cannot take its place
    double price = 0.0;      ///< what it must lower the deviance by
    Maximum best;            ///< six terms, where one was looked for
};

/// \param five          maximum of the five terms
/// \param significance  of the test, over all correlation times together
///
/// The correlation time has no meaning without the noise, so the rise of the deviance is the largest of many that
/// belong together: P(max z > c) <= P(z > c) + L/(2 pi) exp(-c^2/2), with L the length of the path that the unit vector
/// of the score describes as the time goes over its range (R. Davies, Biometrika 64 (1977) 247 and 74 (1987) 33).
Markov find_markov(const Likelihood& likelihood, const Maximum& five, double significance);

}  // namespace ringlock::noise
