#pragma once
#include <numbers>

/// Conversions at the edges. Inside: radians of optical phase and seconds.
/// 1 deg/h is 1 arcsec/s; 1 arcsec/sqrt(s) is 1/60 deg/sqrt(h).
namespace ringlock::units {

inline constexpr double pi = std::numbers::pi;
inline constexpr double two_pi = 2.0 * std::numbers::pi;
inline constexpr double quarter_fringe_rad = 0.5 * pi;
inline constexpr double deg_h_per_deg_s = 3600.0;
inline constexpr double arcsec_per_deg = 3600.0;
inline constexpr double deg_rt_h_per_arcsec_rt_s = 1.0 / 60.0;

}  // namespace ringlock::units
