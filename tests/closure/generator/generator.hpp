#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/record/record.hpp"
#include "tests/closure/generator/fringes.hpp"
#include "tests/closure/generator/rates.hpp"

/// Measured records with known truth, for the closed loop to read blind. An independent simulator: it shares no code
/// with the engine, so that a mistake there cannot hide in both.
namespace ringlock::test::closure {

/// Of the dither's amplitude, relative, turn after turn; the parts add up.
struct AmplitudeWander {
    double walk_per_turn = 0.0;  ///< random walk: rms step from turn to turn
    double rms = 0.0;            ///< first-order autoregression, stationary
    double correlation_s = 1.0;  ///< of that
    double drift_per_s = 0.0;
    double swing = 0.0;  ///< sinusoid
    double swing_period_s = 100.0;
};

/// Of the environment: start + ramp t + swing sin(2 pi t/period), recorded as /environment where `interval_s` > 0 and
/// it is not constant.
struct Temperature {
    double start_c = 20.0;
    double ramp_k_per_h = 0.0;
    double swing_k = 0.0;
    double period_s = 600.0;
    double interval_s = 1.0;

    /// Less that at the start.
    double change_k(double time_s) const;
    double mean_change_k(double from_s, double to_s) const;
    bool constant() const { return ramp_k_per_h == 0.0 && swing_k == 0.0; }
};

struct HarmonicOfCoupling {
    double ratio = 0.0;
    double phase_rad = 0.0;
};
/// A threshold that goes up and down: 1 + ratio sin(2 pi t/period) times as large.
struct SwingOfCoupling {
    double ratio = 0.0;
    double period_s = 60.0;
};
/// From a time on, in the half cycles whose middle is later: the bias is larger by a step, the threshold 1 + ratio
/// times as large, and the coupling acts on the phase plus another.
struct ModeHop {
    double step_deg_h = 0.0;
    double threshold_ratio = 0.0;
    double phase_rad = 0.0;
    double time_s = 0.0;
};
struct ReadoutEllipse {
    double gain = 0.0;
    double offset_sin = 0.0;
    double offset_cos = 0.0;
    double orthogonality_rad = 0.0;
};
struct DitherHarmonic {
    double ratio = 0.0;
    double phase_rad = 0.0;
};

/// One gyro and what its record suffers from. At the defaults: the device of Gao & Deng (2007), no noise, no effect.
///
/// The optical phase obeys the equation of fringes.hpp. Rates and thresholds are constant over each half cycle of the
/// dither, at their mean. The dither angle at turn k is -s_k A (1 + wander_k) + noise_k in optical phase, s_k = +1 at
/// minima, and a half cycle goes along a cosine from one turn's angle to the next.
///
/// Time 0 is a turn of the dither at a maximum. The half cycle that begins there is not recorded: the first row is the
/// minimum at its end.
struct Truth {
    // Device
    double scale_factor_arcsec = 0.5;  ///< K
    double lockin_threshold_deg_h = 300.0;
    double dither_frequency_hz = 124.68198241819081;
    double dither_peak_rate_deg_s = 109.1;
    double bias_deg_h = 0.0;
    double initial_phase_rad = 0.0;  ///< at time 0
    std::size_t turns = 60000;
    std::uint64_t seed = 1;

    // Nuisances
    double injected_noise_rad = 0.0;   ///< rms of the dither angle at each turn, independent, in optical phase
    double injected_noise_even = 0.0;  ///< other than zero: of even density between bounds, not normal
    AmplitudeWander wander;
    double readout_noise = 0.0;  ///< rms on sin and on cos, relative to the amplitude of the fringe
    double clock_hz = 0.0;       ///< turns and pulses fall on the tick before them; 0: times are exact
    double input_rate_deg_h = 0.0;
    record::Track input_profile_deg_h;  ///< added to that; recorded, with it, as /reference
    Temperature temperature;

    // Effects of the library
    double detector_phase_offset_rad = 0.0;  ///< the coupling acts on sin(psi + this), detectors see psi
    ReadoutEllipse readout_ellipse;
    double missed_counts_per_turn = 0.0;  ///< probability that the counter loses one pulse in a half cycle
    HarmonicOfCoupling lockin_second_harmonic;
    double lockin_temperature_per_k = 0.0;
    double lockin_turn_asymmetry = 0.0;
    double dither_asymmetry = 0.0;  ///< peak rates Omega_D (1 +- this), durations (1 -+ this)/(2 f)
    DitherHarmonic dither_second_harmonic;
    double scale_factor_error = 0.0;  ///< input rates (not the dither, whose amplitude is unknown) count 1 + this
    double bias_temperature_deg_h_per_k = 0.0;
    double null_shift_deg_h_per_k_h = 0.0;  ///< bias for each kelvin an hour of the temperature's slope
    ModeHop mode_hop;
    RateTruth rates;  ///< those of the library and others that are rates of their own

    // Effects that the library does not have
    double dither_third_harmonic = 0.0;  ///< of the dither rate, in phase with the first, the swing kept
    HarmonicOfCoupling lockin_third_harmonic;
    SwingOfCoupling lockin_swing;
    double bias_per_rate_squared_h_deg = 0.0;        ///< bias = this times the square of the input rate [1/(deg/h)]
    double bias_per_relative_amplitude_deg_h = 0.0;  ///< bias = this times the half cycle's relative amplitude change

    /// What the operator declares; not given: K, threshold, dither and the settings of the readout as they are, and the
    /// constant input rate, but not the bias.
    std::optional<record::Declared> declared;

    Accuracy accuracy;
};

/// Integrates the records, several at a time in vector lanes, groups of them in threads. What a truth gives does not
/// depend on the others.
///
/// Rows: zero-rate points are where the phase rate, the lock-in included, vanishes; `quarter_count` is
/// floor(psi/(pi/2)) there less missed pulses: lost on the way up the count is too low from then on, on the way down
/// too high. Accelerations: on either side the times of the two nearest quarter fringes, and their distances d_1, d_2
/// from the phase of the extremum as the detectors read it: sqrt(a) = (sqrt(2 d_2) - sqrt(2 d_1))/(t_2 - t_1); 0 where
/// the clock does not tell the two apart.
///
/// Throws InputError where a truth makes no sense, RunError where a phase does not reverse.
std::vector<record::Record> generate(std::span<const Truth> truths);

/// The same with the true phase beside each row; for tests.
struct Trajectory {
    std::vector<double> dither_turn_s;        ///< time of the dither's turn
    std::vector<double> turn_phase_rad;       ///< optical phase at the dither's turn, in [0, 2 pi)
    std::vector<double> lockin_rad;           ///< what the lock-in has added since time 0 at the dither's turn
    std::vector<double> zero_rate_phase_rad;  ///< optical phase at the zero-rate point, in [0, 2 pi)
    std::vector<double> plain_rad;            ///< phase of drive and input alone since time 0
    // Half cycles that end at the row:
    std::vector<double> amplitude_rad;
    std::vector<double> rate_rad_s;
    std::vector<double> b_rad_s;
};
struct Generated {
    record::Record record;
    Trajectory trajectory;
};
std::vector<Generated> generate_with_trajectory(std::span<const Truth> truths);

}  // namespace ringlock::test::closure
