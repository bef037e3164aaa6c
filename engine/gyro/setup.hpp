#pragma once

/// The device: the parameters of one gyro, in the units of scenarios and results.
namespace ringlock::gyro {

/// Errors of the quadrature detectors: sin = (1 + gain) sin(psi) + offset_sin, cos = cos(psi + orthogonality_rad) +
/// offset_cos.
struct Ellipse {
    double gain = 0.0;
    double offset_sin = 0.0;
    double offset_cos = 0.0;
    double orthogonality_rad = 0.0;

    bool operator==(const Ellipse&) const = default;
};

/// Constants of one gyro after its parameters are drawn and changed by the effects.
struct Setup {
    double scale_factor_arcsec = 0.5;       ///< K: arcsec per fringe
    double lockin_threshold_deg_h = 300.0;  ///< Omega_L
    double coupling_phase_rad = 0.0;        ///< the coupling acts on sin(psi + coupling_phase_rad)
    double dither_frequency_hz = 0.0;
    double dither_peak_rate_deg_s = 0.0;  ///< mean of the peak rates of positive and negative half cycles
    double dither_asymmetry_ratio = 0.0;  ///< positive half cycles stronger by it, and shorter
    double dither_harmonic_ratio = 0.0;   ///< second harmonic of the dither rate over the first
    double dither_harmonic_phase_rad = 0.0;
    double lockin_turn_asymmetry = 0.0;  ///< threshold (1 + it) times at minima of the phase, (1 - it) times at maxima
    double lockin_second_ratio = 0.0;    ///< coupling on sin(2 psi + lockin_second_phase_rad) over that on sin(psi)
    double lockin_second_phase_rad = 0.0;
    double input_rate_deg_h = 0.0;
    double initial_phase_rad = 0.0;  ///< optical phase at the first turn
    Ellipse ellipse;
    double missed_count_probability = 0.0;  ///< of the counter, one pulse in a half cycle

    bool operator==(const Setup&) const = default;
};

}  // namespace ringlock::gyro
