#pragma once
#include <cstdint>
#include <optional>
#include <span>

namespace ringlock::allan {

/// Fewest decimated phase points from which a noise type is identified (Riley & Greenhall 2004 advise about 30).
inline constexpr std::int64_t noise_identification_points = 30;

/// Power-law exponent alpha of the noise that dominates at one averaging factor: S_y(f) ~ f^alpha.
///
/// \param phase   phase samples, any unit
/// \param m       averaging factor >= 1
/// \param most_differences  how often the phase may be differenced: 2 for Allan deviations, 3 for Hadamard's
/// \return 2 (white phase), 1, 0 (white frequency, angle random walk), -1 (flicker), -2 (rate random walk), with three
///         differences down to -4; nothing where fewer than noise_identification_points remain or the decimated data
///         do not vary
///
/// Of very long records a part in the middle is looked at, 2^20 decimated points: they tell alpha to a thousandth.
///
/// Lag-1 autocorrelation r of the phase taken every m points, a parabola removed, differenced d times until
/// rho = r/(1+r) < 1/4; then alpha = 2 - 2 d - round(2 rho). W. Riley, C. Greenhall, "Power law noise identification
/// using the lag 1 autocorrelation", 18th EFTF (2004); NIST SP1065 section 5.5.6.
std::optional<int> identify_noise(std::span<const double> phase, std::int64_t m, int most_differences = 2);

}  // namespace ringlock::allan
