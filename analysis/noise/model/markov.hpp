#pragma once
#include "analysis/noise/model/subsets.hpp"

namespace ringlock::noise {

/// Exponentially correlated noise in addition to the five terms, at its likeliest correlation time.
struct Markov {
    double evidence = 0.0;     ///< by how much it lowers the deviance; 0 where the time is not inside its range
    double path_length = 0.0;  ///< of the search, see price()
    Maximum best;              ///< six terms, or the five

    /// What it must lower the deviance by so that this share of records without it show as much.
    ///
    /// The correlation time has no meaning without the noise, so the rise is the largest of many that belong together:
    /// P(max z > c) <= P(z > c) + L/(2 pi) exp(-c^2/2), with L the length of the path that the unit vector of the score
    /// describes as the time goes over its range (R. Davies, Biometrika 64 (1977) 247 and 74 (1987) 33).
    double price(double significance) const;
    bool supported(double significance) const { return evidence > 0.0 && evidence >= price(significance); }
};

/// \param five  maximum of the five terms
Markov find_markov(const Likelihood& likelihood, const Maximum& five);

}  // namespace ringlock::noise
