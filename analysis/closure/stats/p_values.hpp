#pragma once
#include <vector>

/// How probable something is by chance.
namespace ringlock::closure {

/// P(chi-squared with so many degrees of freedom > x).
double chi2_tail(double x, int freedom);

/// P(the least of `count` independent p-values <= p).
double of_several(double p, double count);

/// Davies (Biometrika 74, 1987, 33): a bound for the p-value of the largest chi-squared over a nuisance parameter, from
/// how much its root varies over the search. Of one degree of freedom the root has a sign.
double davies_bound(double chi2, const std::vector<double>& roots, int freedom = 1);

/// What of a gain of the log-likelihood goes when the amplitudes that make it are integrated out, as the course of a
/// random process is in its own likelihood: normal about zero with their own covariance times a factor, the factor
/// being the likeliest (George and Foster, Biometrika 87, 2000, 731: the marginal likelihood of one model).
double cost_of_amplitudes(double gain, int amplitudes);

/// How many independent places a step anywhere in white noise is worth, but for that share of it at either end, at that
/// chi-squared: the probability of the largest standardised Brownian bridge (Miller and Siegmund, Biometrics 38, 1982,
/// 1011) over that of one place.
double places_of_step(double chi2, double share_at_ends);

/// The same for a line at that chi-squared of its two amplitudes, over so many cycles a record of frequency: the
/// expected number of crossings of a chi-squared process (Davies 1987; Baluev, Mon. Not. R. Astron. Soc. 385, 2008,
/// 1279), over the probability at one place.
double places_of_frequency(double chi2, double cycles);

/// That bound over the p-value at one place: the number of independent places that the search is worth, for any degrees
/// of freedom.
double davies_places(double chi2, const std::vector<double>& roots);

}  // namespace ringlock::closure
