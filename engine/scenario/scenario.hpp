#pragma once
#include <cstdint>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "engine/gyro/resonator.hpp"
#include "engine/reader/settings.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/design.hpp"

/// Plain, validated description of a study. Units are in the names; K is arcsec per fringe (2 pi of optical phase).
namespace ringlock::scenario {

/// The optical cavity.
struct Gyro {
    double scale_factor_arcsec = 0.5;       ///< K: arcsec of rotation per fringe
    double lockin_threshold_deg_h = 300.0;  ///< Omega_L
    bool operator==(const Gyro&) const = default;
};

/// The mechanical dither, a sinusoid before noise and effects.
struct Dither {
    double frequency_hz = 783.4 / (2.0 * std::numbers::pi);  ///< Gao & Deng 2007: 783.4 rad/s
    double peak_rate_deg_s = 109.1;                          ///< Omega_D
    /// The amplitude at a turn is Omega_D/w_D (1 + drift t + W(t)), W a random walk of variance wander^2 t.
    double amplitude_wander_relative_rt_s = 0.0;
    double amplitude_drift_relative_per_h = 0.0;
    bool operator==(const Dither&) const = default;
};

enum class NoiseModel { turns, drive };

/// Random noise injected into the dither: on the angles of the turns directly, or on the force that drives the
/// resonator.
struct NoiseInjection {
    NoiseModel model = NoiseModel::turns;
    double turn_phase_rms_rad = 3.0;    ///< rms of the noise at each turn, in optical phase (K/(2 pi) arcsec each)
    double drive_noise_relative = 0.0;  ///< the other way to give the strength: rms of the force over its mean
    double resonator_q = 100.0;
    gyro::NoiseForm form = gyro::NoiseForm::held;
    gyro::NoiseDistribution distribution = gyro::NoiseDistribution::gaussian;
    std::int64_t hold_half_cycles = 1;
    double modulation_hz = 1.0;
    double amplitude_loop_hz = 0.0;
    bool operator==(const NoiseInjection&) const = default;
};

enum class ReadoutModel { ideal, latched, instrument };
enum class PhaseFrom { detectors, detectors_and_pulses };
enum class AngleOutput { interpolated, quarter_fringe };

/// Readout of the phase by the electronics.
struct Readout {
    ReadoutModel model = ReadoutModel::latched;
    AngleOutput angle_output = AngleOutput::interpolated;
    double clock_hz = 100e6;                 ///< counter clock that times pulses and turns
    double detector_noise_relative = 0.005;  ///< rms noise of each detector sample over the fringe amplitude
    bool ellipse_correction = false;         ///< learn the detectors' ellipse and make it a circle
    // Of the instrument only:
    PhaseFrom phase_from = PhaseFrom::detectors_and_pulses;
    double comparator_noise_relative = 0.005;      ///< rms noise of a comparator's input when it switches
    double comparator_hysteresis_relative = 0.03;  ///< comparators switch this far beyond zero
    double detector_bandwidth_hz = 10e6;           ///< of detectors and comparators; 0: unlimited
    std::int64_t adc_bits = 12;                    ///< 0: continuous
    bool operator==(const Readout&) const = default;
};

/// Errors of the calibration that the compensators receive.
struct Calibration {
    double threshold_error_relative = 0.0;  ///< calibrated lock-in threshold over the true one, less one
    bool operator==(const Calibration&) const = default;
};

/// Rate of the case about the input axis, the dither apart.
struct InputRate {
    double rate_deg_h = 15.0;
    double sweep_stop_deg_h = 15.0;  ///< last rate of a sweep that starts at rate_deg_h
    std::int64_t sweep_points = 1;   ///< rates in the sweep; each gets ensemble.gyros gyros
    /// A rate that varies in time in place of rate_deg_h: linear between these points, constant beyond them.
    std::vector<double> profile_time_s = {};
    std::vector<double> profile_rate_deg_h = {};
    bool operator==(const InputRate&) const = default;
};

/// Temperature of the gyros against that at the start: ramp t + swing sin(2 pi t / period), or a profile.
struct Environment {
    double temperature_ramp_k_per_h = 0.0;
    double temperature_swing_k = 0.0;
    double temperature_period_s = 86400.0;
    /// A temperature that takes the place of ramp and swing: linear between these points, constant beyond them. Only
    /// its difference from that at the start of the run counts.
    std::vector<double> profile_time_s = {};
    std::vector<double> profile_temperature_k = {};
    bool operator==(const Environment&) const = default;
};

/// Whether the temperature changes at all.
bool temperature_varies(const Environment& environment);

/// Temperature less that at the start [K].
double temperature_change_k(const Environment& environment, double time_s);

/// How many gyros, for how long, and how they differ.
struct Ensemble {
    std::int64_t gyros = 64;
    /// That many consecutive gyros are the same one, switched on again: its constants are drawn once, initial phases
    /// and noises each time.
    std::int64_t turn_ons = 1;
    double settle_s = 0.0;  ///< simulated before the record begins; rounded to whole dither cycles
    double duration_s = 600.0;
    std::uint64_t seed = 1;
    double initial_phase_spread_rad = 2.0 * std::numbers::pi;  ///< full width of a uniform distribution
    double dither_asymmetry_sd_ratio = 0.001;
    double lockin_threshold_sd_relative = 0.0;
    double dither_amplitude_sd_relative = 0.001;
    bool operator==(const Ensemble&) const = default;
};

enum class PropagationMethod { turn_map, direct };

/// How the equation of motion is solved.
struct Propagation {
    PropagationMethod method = PropagationMethod::turn_map;
    double direct_tolerance_rad = 1e-10;    ///< error of a half cycle by the direct integrator
    double turn_map_tolerance_rad = 1e-10;  ///< interpolation error per turn of the turn map
    bool operator==(const Propagation&) const = default;
};

/// Content of the result file.
struct Output {
    double sample_interval_s = 1.0;          ///< of the decimated angle record; rounded to whole outputs
    bool angle_record = true;                ///< store the record of every gyro and arm, not only its statistics
    std::vector<double> angle_after_s = {};  ///< times since the start of the record at which angle errors are computed
    std::vector<double> tau_s = {};          ///< averaging times of deviations in addition to the octaves
    bool operator==(const Output&) const = default;
};

/// Limits that a gyro must meet to pass; 0: no limit.
struct Specification {
    double arw_deg_rt_h = 0.0;            ///< largest angle random walk
    double bias_stability_deg_h = 0.0;    ///< largest Allan deviation at at_s
    double at_s = 100.0;                  ///< averaging time of bias_stability_deg_h
    double rate_error_deg_h = 0.0;        ///< largest magnitude of the mean rate error over the record
    double scale_factor_error_ppm = 0.0;  ///< largest magnitude of the slope of output over input rate less one
    double angle_error_arcsec = 0.0;      ///< largest magnitude of the angle beyond the input's at after_s
    double after_s = 100.0;               ///< time of angle_error_arcsec
    bool operator==(const Specification&) const = default;
};

/// Whether any limit is set.
bool asks(const Specification& specification);

enum class RecordKind { turns, samples };

/// Content of the record of a gyro that `ringlock record` writes.
struct RecordSettings {
    RecordKind kind = RecordKind::turns;
    Arm trajectory = parse_arm("noise_injected");  ///< for samples any arm, for turns one without compensator
    double rate_hz = 100.0;                        ///< of samples
    double temperature_interval_s = 1.0;           ///< between rows of the temperature, where it changes
    bool operator==(const RecordSettings&) const = default;
};

/// The reader of a record of samples, and of the arms of a study where these are read.
struct ReaderSettings : reader::Settings {
    double output_hz = 0.0;  ///< at which the arms of a study are read; 0: they are not
    bool operator==(const ReaderSettings&) const = default;
};

/// Effects beyond the base equation: effect name -> parameter -> value. Holds every effect of the registry with every
/// one of its parameters, at its default where the scenario does not name it.
using EffectSettings = std::map<std::string, std::map<std::string, double>>;

/// Every effect of the registry at its defaults.
EffectSettings default_effect_settings();

/// Input rate of one point of the sweep, 0 <= point < sweep_points; the points are evenly spaced, both ends included.
double input_rate_deg_h(const InputRate& input, std::int64_t point);

/// The value of a profile: linear between its points, constant beyond them. It has a point at least, and increasing
/// times.
double profile_value(const std::vector<double>& times_s, const std::vector<double>& values, double time_s);

/// Whether the input rate follows a profile. The functions below need one.
bool has_profile(const InputRate& input);
double profile_rate_deg_h(const InputRate& input, double time_s);
/// Rotation of the case by the profile between start_s and start_s + duration_s [arcsec].
double profile_angle_arcsec(const InputRate& input, double start_s, double duration_s);

/// Largest change of the dither's amplitude within six standard deviations over that time, relative.
double amplitude_change_relative(const Dither& dither, double duration_s);

struct Scenario {
    std::string device;  ///< whose constants stand in place of the defaults (devices.hpp); empty: none was named
    Gyro gyro;
    Dither dither;
    NoiseInjection noise_injection;
    Readout readout;
    Calibration calibration;
    InputRate input;
    Environment environment;
    EffectSettings effects = default_effect_settings();
    Ensemble ensemble;
    std::vector<Arm> arms = parse_arms({"ideal", "uncompensated", "noise_injected",
                                        "noise_injected+compensated_published", "noise_injected+compensated"});
    Propagation propagation;
    Output output;
    Specification specification;
    Design design;  ///< empty: the scenario itself is the only point of the study
    Stop stop;      ///< where it asks(), it sets the number of gyros
    RecordSettings record;
    ReaderSettings reader;
    bool operator==(const Scenario&) const = default;
};

}  // namespace ringlock::scenario
