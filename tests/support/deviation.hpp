#pragma once
#include <cmath>

#include "engine/gyro/half_cycle.hpp"

namespace ringlock::test {

/// The equation of motion for x, the deviation from the plain phase:
///
///     x' = b(t) F(phase + plain phase(t) + x),
///
/// b(t), F and the plain phase as gyro::Coupling and gyro::HalfCycle say, written out here once more.
/// The plain phase is known in closed form and is 1e5 times larger; integrated, it would cost digits.
class Deviation {
   public:
    /// `phase_rad`: psi at the first turn.
    Deviation(const gyro::Coupling& coupling, const gyro::HalfCycle& half, double phase_rad)
        : coupling_(coupling),
          half_(half),
          start_rad_(phase_rad),
          angular_frequency_rad_s_(half.angular_frequency_rad_s()) {}

    /// x' [rad/s].
    double rate_rad_s(double t_s, double x_rad) const {
        const double angle = angular_frequency_rad_s_ * t_s;
        const double s = std::sin(0.5 * angle);
        double plain_rad = half_.rate_rad_s * t_s + 2.0 * half_.sign * half_.amplitude_rad * s * s;
        double b_rad_s = coupling_.b_rad_s;
        // Without them, sines and cosines are saved that would double the cost.
        if (half_.harmonic_ratio != 0.0) {
            plain_rad += half_.amplitude_rad * half_.harmonic_ratio * std::sin(angle + half_.harmonic_phase_rad) *
                         std::sin(angle);
        }
        if (coupling_.turn_asymmetry != 0.0) b_rad_s *= 1.0 + coupling_.turn_asymmetry * half_.sign * std::cos(angle);
        const double psi_rad = start_rad_ + plain_rad + x_rad;
        double f = std::sin(psi_rad + coupling_.phase_rad);
        if (coupling_.second_ratio != 0.0) {
            f += coupling_.second_ratio * std::sin(2.0 * psi_rad + coupling_.second_phase_rad);
        }
        return b_rad_s * f;
    }
    /// A bound of the phase rate [rad/s].
    double fastest_rad_s() const {
        return half_.amplitude_rad * angular_frequency_rad_s_ * (1.0 + std::abs(half_.harmonic_ratio)) +
               std::abs(half_.rate_rad_s) +
               coupling_.b_rad_s * (1.0 + std::abs(coupling_.turn_asymmetry)) *
                   (1.0 + std::abs(coupling_.second_ratio));
    }

   private:
    gyro::Coupling coupling_;
    gyro::HalfCycle half_;
    double start_rad_;
    double angular_frequency_rad_s_;
};

}  // namespace ringlock::test
