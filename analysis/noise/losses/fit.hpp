#pragma once
#include <cstddef>
#include <vector>

#include "analysis/allan/sums/phase.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/noise/losses/lossy_rates.hpp"

namespace ringlock::noise {

/// Noise coefficients from all data of a record with gaps.
///
/// \param phase   in arcsec, as allan::phase_of() makes it; without gaps the result is that of fit_noise() above
/// \param tau0_s  sampling interval [s], > 0
///
/// Maximum of the likelihood of the samples that are there: those that are missing are filled in under the model that
/// is fitted (docs/dev/allan-coefficients.md, "Missing samples"). Fewer present increments than options.fewest_samples
/// are not fitted. Deterministic, whatever the number of threads; throws InputError as fit_noise() does.
NoiseFit fit_noise(const allan::Phase& phase, double tau0_s, const Options& options = {});

/// The same of rates, and one way in which the noise of the record may have gone on in its gaps.
struct CompletedFit {
    NoiseFit fit;
    bool given_up = false;     ///< the gaps take too long to be filled in: nothing is fitted
    std::vector<double> rate;  ///< all rates: those that are there as they are, the others drawn from the fit
};
CompletedFit fit_and_complete(const LossyRates& rates, double tau0_s, const Options& options = {});

/// Whether a record with gaps is fitted as a whole in a time of seconds, and has enough data for that.
bool fitted_as_a_whole(const LossyRates& rates);

/// Above so many intervals, or below this share of data, a record with gaps takes minutes.
inline constexpr std::size_t most_lossy_rates = 400000;
inline constexpr double least_share_present = 0.25;

}  // namespace ringlock::noise
