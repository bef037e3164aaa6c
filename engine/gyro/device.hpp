#pragma once
#include "engine/gyro/half_cycle.hpp"
#include "engine/gyro/setup.hpp"

namespace ringlock::gyro {

/// A gyro's constants in the units of the inside: radians of optical phase and seconds.
///
/// The dither has peak rates Omega_D (1 +- ratio) in half cycles that last (pi / w_D)(1 -+ ratio): swings of the two
/// signs are equal, so that the asymmetry is no rate of its own, and the period stays 2 pi / w_D.
struct Device {
    explicit Device(const Setup& setup);

    double phase_per_arcsec;      ///< C = 2 pi / K [rad/arcsec]
    Coupling coupling;            ///< b = C Omega_L
    double dither_amplitude_rad;  ///< half the swing between turns
    double positive_duration_s;   ///< of a half cycle with positive rate
    double negative_duration_s;
    double input_rate_rad_s;  ///< C times the input rate
    double initial_phase_rad;
    double harmonic_ratio;  ///< second harmonic of the dither rate
    double harmonic_phase_rad;

    double period_s() const { return positive_duration_s + negative_duration_s; }
    /// Half cycle of that sign (+1, -1) and amplitude [rad].
    HalfCycle half_cycle(double sign, double amplitude_rad) const {
        return {
            sign,           amplitude_rad,     sign > 0 ? positive_duration_s : negative_duration_s, input_rate_rad_s,
            harmonic_ratio, harmonic_phase_rad};
    }
};

}  // namespace ringlock::gyro
