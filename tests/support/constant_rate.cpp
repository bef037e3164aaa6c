#include "tests/support/constant_rate.hpp"

#include <cmath>
#include <complex>

#include "engine/propagate/circle_map.hpp"

namespace ringlock::test {

double constant_rate_gain_rad(double phase_rad, double rate_rad_s, double duration_s, const gyro::Coupling& coupling) {
    const double b = coupling.b_rad_s;
    const double sign = rate_rad_s < 0.0 ? -1.0 : 1.0;  // psi -> -psi turns the rate round
    const double g = std::abs(rate_rad_s);
    const double psi = sign * (phase_rad + coupling.phase_rad);
    if (b == 0.0) return 0.0;
    if (g > b) {
        // phi = psi + 2 arg(1 + i k exp(-i psi)) turns uniformly at sqrt(g^2 - b^2).
        const double beat = std::sqrt((g - b) * (g + b));
        const std::complex<double> ik(0.0, b / (g + beat));
        const double into = propagate::twice_arg(ik, -psi);
        const double phi = psi + into + beat * duration_s;
        const double slowed = -b * b / (g + beat) * duration_s;  // (beat - g) t without cancellation
        return sign * (into + slowed + propagate::twice_arg(-ik, -phi));
    }
    // Locked or just so: the matrix exponential; the phase moves by less than a fringe, so that the branch is clear.
    const double lambda = 0.5 * std::sqrt((b - g) * (b + g));
    const double x = lambda * duration_s;
    // tanh(x)/lambda keeps its meaning where cosh overflows and where lambda is 0.
    const double t = x > 0.0 ? std::tanh(x) / lambda : duration_s;
    const std::complex<double> alpha(1.0, 0.5 * g * t);
    const double beta = -0.5 * b * t;
    const std::complex<double> factor = alpha + beta * std::polar(1.0, -psi);
    return sign * (2.0 * std::arg(factor) - g * duration_s);
}

}  // namespace ringlock::test
