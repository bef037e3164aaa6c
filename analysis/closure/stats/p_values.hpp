#pragma once
#include <vector>

/// Probabilities by chance.
namespace ringlock::closure {

/// P(chi-squared with `freedom` degrees of freedom > x).
double chi2_tail(double x, int freedom);

/// P(smallest of `count` independent p-values <= p).
double of_several(double p, double count);

/// A bound for the p-value of the largest chi-squared over a nuisance parameter, from the variation of its root over
/// the search (Davies, Biometrika 74, 1987, 33). With one degree of freedom the root has a sign.
double davies_bound(double chi2, const std::vector<double>& roots, int freedom = 1);

/// The part of a gain of the log-likelihood that is lost when the amplitudes that make it are integrated out, as the
/// path of a random process is in its own likelihood. The prior is normal about zero with the amplitudes' own
/// covariance times the most likely factor (George and Foster, Biometrika 87, 2000, 731: the marginal likelihood of one
/// model).
double cost_of_amplitudes(double gain, int amplitudes);

/// The number of independent positions that a search for a step anywhere in white noise is worth at this chi-squared,
/// except in that share of the record at either end: the probability of the maximum of a standardised Brownian bridge
/// (Miller and Siegmund, Biometrics 38, 1982, 1011) over that at one place.
double look_elsewhere_of_step(double chi2, double share_at_ends);

/// The same for a line with this chi-squared of its two amplitudes, over that number of cycles a record of frequency:
/// the expected number of crossings of a chi-squared process (Davies 1987; Baluev, Mon. Not. R. Astron. Soc. 385, 2008,
/// 1279) over the probability at one place.
double look_elsewhere_of_frequency(double chi2, double cycles);

/// davies_bound over the p-value at one place: the number of independent positions that the search is worth, for any
/// number of degrees of freedom.
double davies_look_elsewhere(double chi2, const std::vector<double>& roots);

}  // namespace ringlock::closure
