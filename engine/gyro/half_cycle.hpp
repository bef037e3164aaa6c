#pragma once
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::gyro {

/// One half cycle of the dither, from the turn at time 0 to the turn at `duration_s`. The dither angle goes along a
/// cosine from one turn's angle to the next; a second harmonic of the dither rate may be added, and the amplitude may
/// change over the half cycle. The rate of drive and input is, with w = pi / duration,
///
///     g(t) = rate + A w (sign sin(w t) + ratio sin(2 w t + harmonic_phase)) + sign change w sin(w t) (w t/pi - 1/2).
///
/// With a change it is the path of a resonator whose force makes its amplitude grow: the acceleration at either turn is
/// w^2 times the angle there, and is continuous there (docs/noise-injection.md). All in radians of optical phase.
struct HalfCycle {
    double sign = 1.0;           ///< +1: the dither rate is positive (from a minimum to a maximum), -1: negative
    double amplitude_rad = 0.0;  ///< A: half the swing; the mean of the amplitudes at the two turns
    double duration_s = 0.0;
    double rate_rad_s = 0.0;      ///< phase rate of the input rotation, constant over the half cycle
    double harmonic_ratio = 0.0;  ///< second harmonic of the dither rate over the first
    double harmonic_phase_rad = 0.0;
    double amplitude_change_rad = 0.0;  ///< amplitude at the end less that at the beginning

    double angular_frequency_rad_s() const { return units::pi / duration_s; }
    /// Phase acceleration of the drive at the turn at its beginning (end 0) or end (1) [rad/s^2], a magnitude.
    double end_acceleration_rad_s2(int end = 0) const {
        const double w = angular_frequency_rad_s();
        const double harmonic = 2.0 * harmonic_ratio * std::cos(harmonic_phase_rad);
        const double change = (end == 0 ? -0.5 : 0.5) * amplitude_change_rad;
        return w * w * std::abs(amplitude_rad + change + amplitude_rad * (end == 0 ? sign : -sign) * harmonic);
    }
    /// Amplitude at the turn at its beginning (end 0) or end (1) [rad].
    double end_amplitude_rad(int end) const { return amplitude_rad + (end == 0 ? -0.5 : 0.5) * amplitude_change_rad; }
    /// Phase that drive and input alone add by time `t_s` (no lock-in).
    double plain_phase_rad(double t_s) const {
        const double x = angular_frequency_rad_s() * t_s;
        const double s = std::sin(0.5 * x);
        // 1 - cos x = 2 sin^2(x/2) and cos f - cos(2 x + f) = 2 sin(x + f) sin x keep their digits
        const double swung =
            rate_rad_s * t_s +
            amplitude_rad * (sign * 2.0 * s * s + harmonic_ratio * std::sin(x + harmonic_phase_rad) * std::sin(x));
        if (amplitude_change_rad == 0.0) return swung;
        const double grown = (std::sin(x) - x * std::cos(x)) / units::pi - s * s;
        return swung + sign * amplitude_change_rad * grown;
    }
    double plain_phase_total_rad() const { return rate_rad_s * duration_s + 2.0 * sign * amplitude_rad; }
    /// The half cycle as its turn at `end` sees it, 0 at the beginning, with sign +1: psi -> -psi turns a negative one
    /// upright, psi(t) -> pi - psi(T - t) runs it backwards.
    HalfCycle upright(int end) const {
        // sin(2 w (T - t) + f) = -sin(2 w t - f)
        const double back = end == 0 ? 1.0 : -1.0;
        return {1.0,
                amplitude_rad,
                duration_s,
                sign * rate_rad_s,
                back * sign * harmonic_ratio,
                back * harmonic_phase_rad,
                back * amplitude_change_rad};
    }
    /// Phase rate of drive and input, g(t) [rad/s].
    double drive_rate_rad_s(double t_s) const {
        const double w = angular_frequency_rad_s();
        const double grown = amplitude_change_rad * (t_s / duration_s - 0.5);
        return rate_rad_s + sign * (amplitude_rad + grown) * w * std::sin(w * t_s) +
               amplitude_rad * w * harmonic_ratio * std::sin(2.0 * w * t_s + harmonic_phase_rad);
    }
};

/// The lock-in term
///
///     b (1 + turn_asymmetry cos(dither angle's phase)) (sin(psi + phase) + second_ratio sin(2 psi + second_phase)):
///
/// the cosine is 1 at minima of the phase and -1 at maxima.
struct Coupling {
    double b_rad_s = 0.0;  ///< b = (2 pi / K) Omega_L
    double phase_rad = 0.0;
    double turn_asymmetry = 0.0;
    double second_ratio = 0.0;  ///< second harmonic of the coupling over the first; makes the flow no Moebius map
    double second_phase_rad = 0.0;

    /// Phase of the second harmonic in the angle theta = psi + phase: sin(2 psi + second_phase) =
    /// sin(2 theta + this).
    double second_from_first_rad() const { return second_phase_rad - 2.0 * phase_rad; }
    /// The whole coupling at another phase of it: both harmonics move.
    Coupling moved_to(double wanted_phase_rad) const {
        Coupling moved = *this;
        moved.phase_rad = wanted_phase_rad;
        moved.second_phase_rad += 2.0 * (wanted_phase_rad - phase_rad);
        return moved;
    }
};

}  // namespace ringlock::gyro
