#pragma once
#include <limits>

namespace ringlock::allan {

/// No averaging of the phase: it is sampled, as an integrating instrument does.
inline constexpr double sampled = std::numeric_limits<double>::infinity();

/// Generalised autocovariance of phase whose rate has the spectrum f^alpha, up to a positive factor. The covariance of
/// differences follows from it. Two differences d of order n with alpha + 2n > 1 have sum_ij d_i e_j s(t_i - t_j).
///
/// \param t       lag, in units of any length of time
/// \param filter  the phase is averaged over 1/filter of that unit; `sampled`: not at all (alpha <= 0 only)
/// \param alpha   -4 ... 2
///
/// C. Greenhall, W. Riley, "Uncertainty of stability variances based on finite differences", 35th PTTI (2003), section
/// II. Throws std::domain_error for another alpha.
double phase_autocovariance(double t, double filter, int alpha);

}  // namespace ringlock::allan
