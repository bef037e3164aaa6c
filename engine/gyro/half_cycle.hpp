#pragma once
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::gyro {

/// One half cycle of the dither, from the turn at time 0 to the turn at `duration_s`: the dither angle goes along a
/// cosine from one turn's angle to the next, so its rate is zero at both ends. All in radians of optical phase.
struct HalfCycle {
    double sign = 1.0;           ///< +1: the dither rate is positive (from a minimum to a maximum), -1: negative
    double amplitude_rad = 0.0;  ///< half the swing
    double duration_s = 0.0;
    double rate_rad_s = 0.0;  ///< phase rate of the input rotation, constant over the half cycle

    double angular_frequency_rad_s() const { return units::pi / duration_s; }
    /// Phase acceleration at either end [rad/s^2], a magnitude.
    double end_acceleration_rad_s2() const {
        const double w = angular_frequency_rad_s();
        return amplitude_rad * w * w;
    }
    /// Phase that drive and input alone add by time `t_s` (no lock-in).
    double plain_phase_rad(double t_s) const {
        const double s = std::sin(0.5 * angular_frequency_rad_s() * t_s);
        return rate_rad_s * t_s + sign * amplitude_rad * 2.0 * s * s;  // 1 - cos x = 2 sin^2(x/2) keeps its digits
    }
    double plain_phase_total_rad() const { return rate_rad_s * duration_s + 2.0 * sign * amplitude_rad; }
    /// Phase rate of drive and input, g(t) [rad/s].
    double drive_rate_rad_s(double t_s) const {
        const double w = angular_frequency_rad_s();
        return rate_rad_s + sign * amplitude_rad * w * std::sin(w * t_s);
    }
};

/// The lock-in term b sin(psi + phase).
struct Coupling {
    double b_rad_s = 0.0;  ///< b = (2 pi / K) Omega_L
    double phase_rad = 0.0;
};

}  // namespace ringlock::gyro
