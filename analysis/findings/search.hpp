#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "analysis/findings/finding.hpp"

namespace ringlock::findings {

/// Thresholds and limits of the search.
struct SearchOptions {
    /// Probability that a record of Gaussian noise has any outlier, any jump, any stretch of another variance by
    /// chance.
    double outlier_level = 1e-3;
    double jump_level = 2e-3;
    double variance_level = 1e-3;
    /// Nearer to either end a jump is not distinguished from outliers [data].
    std::size_t end_of_jump = 10;
    /// A stretch of another variance has at least so many data, and a variance that differs by this factor.
    std::size_t shortest_stretch = 32;
    double least_ratio = 1.5;
    /// Nothing else is searched for where a window of the record, of at least so many data and at most so many windows
    /// in all, is noisier than the usual one by this ratio of variances: a vehicle that moved is no row of outliers.
    std::size_t disturbed_window = 64;
    std::size_t disturbed_windows = 500;
    double disturbed_ratio = 5.0;
    /// The search ends after so many rounds, or where this share of the data has been found to be off: the noise is
    /// then not what the model holds it for.
    int most_rounds = 12;
    double most_outliers = 0.05;
};

/// A series without the outliers and jumps that were found in it.
struct Searched {
    std::vector<Finding> findings;  ///< outliers, jumps and stretches, by row; rows count rates
    std::vector<double> rate;       ///< without them: each taken off by its estimated size
    bool ended = true;              ///< false: the search was given up, and coefficients would mean nothing
};

/// Searches consecutive mean rates for events that the noise of the record does not explain.
///
/// The noise is the maximum of the likelihood of all five terms of the fit, without sinusoids, so that a jump must be
/// likelier than random walk, flicker and ramp. Events are taken off one kind after the other, the least probable
/// first, and the noise is fitted anew. A jump must also lower the deviance of that fit by the threshold of a search
/// over all places. A record with disturbed stretches is not searched further. The spectrum takes a length with small
/// prime factors: among the up to 2 % of the rates that it leaves out at the end of the record only outliers are
/// searched for, and none where the record has sinusoids.
/// \param rate       any unit, any offset; fewer than 64 are not searched
/// \param of_angles  the data were angles: one that is off moves two rates
Searched search_rates(std::span<const double> rate, bool of_angles, const SearchOptions& options = {});

}  // namespace ringlock::findings
