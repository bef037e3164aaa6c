#include "engine/gyro/device.hpp"

namespace ringlock::gyro {

Device::Device(const Setup& setup) {
    const double angular_frequency = units::two_pi * setup.dither_frequency_hz;
    const double ratio = setup.dither_asymmetry_ratio;
    phase_per_arcsec = units::two_pi / setup.scale_factor_arcsec;
    coupling = {phase_per_arcsec * setup.lockin_threshold_deg_h, setup.coupling_phase_rad, setup.lockin_turn_asymmetry,
                setup.lockin_second_ratio, setup.lockin_second_phase_rad};
    dither_amplitude_rad = phase_per_arcsec * setup.dither_peak_rate_deg_s * units::arcsec_per_deg * (1.0 - ratio) *
                           (1.0 + ratio) / angular_frequency;
    positive_duration_s = (1.0 - ratio) * units::pi / angular_frequency;
    negative_duration_s = (1.0 + ratio) * units::pi / angular_frequency;
    input_rate_rad_s = phase_per_arcsec * setup.input_rate_deg_h;
    initial_phase_rad = setup.initial_phase_rad;
    harmonic_ratio = setup.dither_harmonic_ratio;
    harmonic_phase_rad = setup.dither_harmonic_phase_rad;
}

}  // namespace ringlock::gyro
