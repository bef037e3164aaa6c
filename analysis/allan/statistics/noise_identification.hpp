#pragma once
#include <cstdint>
#include <optional>
#include <span>

namespace ringlock::allan {

/// Fewest decimated phase points from which a noise type is identified (Riley & Greenhall 2004 advise about 30).
inline constexpr std::int64_t noise_identification_points = 30;

/// Power-law exponent of the noise that dominates at one averaging factor, S_y(f) ~ f^alpha, before it is rounded.
///
/// \param phase   phase samples, any unit
/// \param m       averaging factor >= 1
/// \param most_differences  how often the phase may be differenced: 2 for Allan deviations, 3 for Hadamard's
/// \return nothing where fewer than noise_identification_points remain or the decimated data do not vary
///
/// Lag-1 autocorrelation r of the phase taken every m points, a parabola removed, differenced d times until
/// rho = r/(1+r) < 1/4; then 2 - 2 (d + rho). W. Riley, C. Greenhall, "Power law noise identification using the lag 1
/// autocorrelation", 18th EFTF (2004); NIST SP1065 section 5.5.6. In long records a part in the middle is used, 2^17
/// decimated points: they determine the exponent to a hundredth.
std::optional<double> noise_exponent(std::span<const double> phase, std::int64_t m, int most_differences = 2);

/// The exponent at one averaging factor, combined with those of the octaves below where points are few.
///
/// \param phase, m, most_differences  as above
/// \return nothing where noise_exponent() has nothing
///
/// An exponent of n points has a standard deviation of 2/sqrt(n) for white noise and about 2.8/sqrt(n) for redder:
/// beyond 200 points it is taken as it is. With fewer it is the mean, weighted by points, with those at m/2, m/4 and
/// m/8, each of which is taken in as long as it is no more than 2.5 standard deviations of the difference from the mean
/// of those before (pooling as far as they agree: O. Lepskii, Theory Probab. Appl. 35 (1991) 454). Phase noise is
/// accepted only where the octave below shows it alone, since it would imply thousands of degrees of freedom.
std::optional<double> pooled_noise_exponent(std::span<const double> phase, std::int64_t m, int most_differences = 2);

/// The kind of noise nearest to an exponent: 2 (white phase), 1, 0 (white frequency, angle random walk), -1 (flicker),
/// -2 (rate random walk); with three differences down to -4.
///
/// The method's formula holds for noise made of independent samples. Rates that are means of a continuous process over
/// tau, as a gyro's are at any tau, have exponents of -1.45 for flicker and -2.40 for a random walk (their differences
/// are correlated; the tests show it), so that flicker ends at -1.72, half-way from -1.45 to -2, and not at -1.5.
int nearest_noise(double exponent, int most_differences = 2);

}  // namespace ringlock::allan
