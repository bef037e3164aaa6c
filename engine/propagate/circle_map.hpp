#pragma once
#include <cmath>
#include <complex>

namespace ringlock::propagate {

/// 2 arg(1 + z exp(i angle)) for |z| < 1: the phase by which a Moebius map of the unit circle moves a point beyond a
/// rotation.
inline double twice_arg(std::complex<double> z, double angle_rad) {
    const double c = std::cos(angle_rad);
    const double s = std::sin(angle_rad);
    return 2.0 * std::atan2(z.real() * s + z.imag() * c, 1.0 + z.real() * c - z.imag() * s);
}

}  // namespace ringlock::propagate
