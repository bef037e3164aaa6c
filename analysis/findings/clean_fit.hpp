#pragma once
#include <optional>
#include <span>

#include "analysis/findings/search.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/noise/losses/lossy_rates.hpp"

namespace ringlock::findings {

/// The noise of a record without the outliers and jumps that were found in it.
struct CleanFit {
    Searched searched;
    noise::NoiseFit noise;
    /// A jump that explains the record as well as a rate random walk does: then that coefficient is not resolved.
    std::optional<Finding> instead_of_walk;
    bool given_up = false;  ///< nothing was fitted: the gaps of the record take too long to be filled in
};

/// Searches the rates of a record of angles for events, takes these off, and estimates the noise coefficients of the
/// rest.
///
/// A rate random walk whose evidence, less the threshold of its test, is smaller than that of one jump in noise without
/// random walk, less the threshold of the search over all places, is not resolved: the jump may be too small to be
/// found as such and still pass for a random walk. Coefficients are withheld (described is false, with the reason)
/// where a stretch has another variance or the search was given up.
/// \param angle_arcsec  accumulated angle at uniform instants, finite
/// \param of_angles     the data were angles: one that is off moves two rates
CleanFit fit_without_events(std::span<const double> angle_arcsec, double tau0_s, bool of_angles,
                            const SearchOptions& options = {});

/// The same of a record with gaps, from all of its data.
///
/// The search wants a record without gaps: they are filled in as the noise of the record may have continued in them
/// (noise::fit_and_complete()), and outliers among these rates are dropped.
CleanFit fit_without_events(noise::LossyRates rates, double tau0_s, bool of_angles, const SearchOptions& options = {});

}  // namespace ringlock::findings
