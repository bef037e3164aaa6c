#include "tests/closure/generator/keys.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>
#include <system_error>

#include "engine/core/error.hpp"

namespace ringlock::test::closure {
namespace {

template <class T>
struct Key {
    std::string_view name;
    double& (*value)(T&);
};

#define RINGLOCK_KEY(T, NAME, MEMBER)                          \
    Key<T> {                                                   \
        NAME, [](T& truth) -> double& { return truth.MEMBER; } \
    }

constexpr Key<Truth> turn_numbers[] = {
    RINGLOCK_KEY(Truth, "scale_factor_arcsec", scale_factor_arcsec),
    RINGLOCK_KEY(Truth, "lockin_threshold_deg_h", lockin_threshold_deg_h),
    RINGLOCK_KEY(Truth, "dither_frequency_hz", dither_frequency_hz),
    RINGLOCK_KEY(Truth, "dither_peak_rate_deg_s", dither_peak_rate_deg_s),
    RINGLOCK_KEY(Truth, "bias_deg_h", bias_deg_h),
    RINGLOCK_KEY(Truth, "initial_phase_rad", initial_phase_rad),
    RINGLOCK_KEY(Truth, "injected_noise_rad", injected_noise_rad),
    RINGLOCK_KEY(Truth, "injected_noise_even", injected_noise_even),
    RINGLOCK_KEY(Truth, "wander.walk_per_turn", wander.walk_per_turn),
    RINGLOCK_KEY(Truth, "wander.rms", wander.rms),
    RINGLOCK_KEY(Truth, "wander.correlation_s", wander.correlation_s),
    RINGLOCK_KEY(Truth, "wander.drift_per_s", wander.drift_per_s),
    RINGLOCK_KEY(Truth, "wander.swing", wander.swing),
    RINGLOCK_KEY(Truth, "wander.swing_period_s", wander.swing_period_s),
    RINGLOCK_KEY(Truth, "readout_noise", readout_noise),
    RINGLOCK_KEY(Truth, "clock_hz", clock_hz),
    RINGLOCK_KEY(Truth, "input_rate_deg_h", input_rate_deg_h),
    RINGLOCK_KEY(Truth, "detector_phase_offset.phase_rad", detector_phase_offset_rad),
    RINGLOCK_KEY(Truth, "readout_ellipse.gain", readout_ellipse.gain),
    RINGLOCK_KEY(Truth, "readout_ellipse.offset_sin", readout_ellipse.offset_sin),
    RINGLOCK_KEY(Truth, "readout_ellipse.offset_cos", readout_ellipse.offset_cos),
    RINGLOCK_KEY(Truth, "readout_ellipse.orthogonality_rad", readout_ellipse.orthogonality_rad),
    RINGLOCK_KEY(Truth, "missed_counts.probability_per_turn", missed_counts_per_turn),
    RINGLOCK_KEY(Truth, "lockin_second_harmonic.ratio", lockin_second_harmonic.ratio),
    RINGLOCK_KEY(Truth, "lockin_second_harmonic.phase_rad", lockin_second_harmonic.phase_rad),
    RINGLOCK_KEY(Truth, "lockin_temperature.relative_per_k", lockin_temperature_per_k),
    RINGLOCK_KEY(Truth, "lockin_turn_asymmetry.ratio", lockin_turn_asymmetry),
    RINGLOCK_KEY(Truth, "dither_asymmetry.ratio", dither_asymmetry),
    RINGLOCK_KEY(Truth, "dither_second_harmonic.ratio", dither_second_harmonic.ratio),
    RINGLOCK_KEY(Truth, "dither_second_harmonic.phase_rad", dither_second_harmonic.phase_rad),
    RINGLOCK_KEY(Truth, "dither_third_harmonic.ratio", dither_third_harmonic),
    RINGLOCK_KEY(Truth, "scale_factor_error.relative", scale_factor_error),
    RINGLOCK_KEY(Truth, "lockin_third_harmonic.ratio", lockin_third_harmonic.ratio),
    RINGLOCK_KEY(Truth, "lockin_third_harmonic.phase_rad", lockin_third_harmonic.phase_rad),
    RINGLOCK_KEY(Truth, "lockin_swing.ratio", lockin_swing.ratio),
    RINGLOCK_KEY(Truth, "lockin_swing.period_s", lockin_swing.period_s),
    RINGLOCK_KEY(Truth, "mode_hop.step_deg_h", mode_hop.step_deg_h),
    RINGLOCK_KEY(Truth, "mode_hop.threshold_ratio", mode_hop.threshold_ratio),
    RINGLOCK_KEY(Truth, "mode_hop.phase_rad", mode_hop.phase_rad),
    RINGLOCK_KEY(Truth, "mode_hop.time_s", mode_hop.time_s),
    RINGLOCK_KEY(Truth, "bias_per_rate_squared_h_deg", bias_per_rate_squared_h_deg),
    RINGLOCK_KEY(Truth, "bias_per_relative_amplitude_deg_h", bias_per_relative_amplitude_deg_h),
};

constexpr Key<SampleTruth> sample_numbers[] = {
    RINGLOCK_KEY(SampleTruth, "rate_hz", rate_hz),
    RINGLOCK_KEY(SampleTruth, "scale_factor_arcsec", scale_factor_arcsec),
    RINGLOCK_KEY(SampleTruth, "mean_rate_deg_h", mean_rate_deg_h),
    RINGLOCK_KEY(SampleTruth, "white_angle_arcsec", white_angle_arcsec),
    RINGLOCK_KEY(SampleTruth, "count_quantization.step_arcsec", count_quantization_arcsec),
    RINGLOCK_KEY(SampleTruth, "dither_residue.frequency_hz", dither_residue.frequency_hz),
    RINGLOCK_KEY(SampleTruth, "dither_residue.drift_hz_per_s", dither_residue.drift_hz_per_s),
    RINGLOCK_KEY(SampleTruth, "dither_residue.amplitude_arcsec", dither_residue.amplitude_arcsec),
    RINGLOCK_KEY(SampleTruth, "dither_residue.phase_rad", dither_residue.phase_rad),
    RINGLOCK_KEY(SampleTruth, "dither_residue.settles_hz", dither_residue.settles_hz),
    RINGLOCK_KEY(SampleTruth, "dither_residue.settling_s", dither_residue.settling_s),
    RINGLOCK_KEY(SampleTruth, "dither_residue.wander_hz", dither_residue.wander_hz),
    RINGLOCK_KEY(SampleTruth, "resampling.from_hz", resampling.from_hz),
    RINGLOCK_KEY(SampleTruth, "case_motion.coherence", case_motion.coherence),
    RINGLOCK_KEY(SampleTruth, "case_motion.rms_arcsec", case_motion.rms_arcsec),
    RINGLOCK_KEY(SampleTruth, "case_motion.centre_hz", case_motion.centre_hz),
    RINGLOCK_KEY(SampleTruth, "case_motion.width_hz", case_motion.width_hz),
    RINGLOCK_KEY(SampleTruth, "accelerometer_noise", accelerometer_noise),
    RINGLOCK_KEY(SampleTruth, "thermometer_noise_k", thermometer_noise_k),
    RINGLOCK_KEY(SampleTruth, "jumping_line.frequency_hz", jumping_line.frequency_hz),
    RINGLOCK_KEY(SampleTruth, "jumping_line.rate_before_deg_h", jumping_line.rate_before_deg_h),
    RINGLOCK_KEY(SampleTruth, "jumping_line.rate_after_deg_h", jumping_line.rate_after_deg_h),
    RINGLOCK_KEY(SampleTruth, "jumping_line.time_s", jumping_line.time_s),
    RINGLOCK_KEY(SampleTruth, "saturation_arcsec", saturation_arcsec),
    RINGLOCK_KEY(SampleTruth, "scale_factor_error.relative", scale_factor_error),
    RINGLOCK_KEY(SampleTruth, "swinging_line.frequency_hz", swinging_line.frequency_hz),
    RINGLOCK_KEY(SampleTruth, "swinging_line.rate_deg_h", swinging_line.rate_deg_h),
    RINGLOCK_KEY(SampleTruth, "swinging_line.deviation_hz", swinging_line.deviation_hz),
    RINGLOCK_KEY(SampleTruth, "swinging_line.period_s", swinging_line.period_s),
    RINGLOCK_KEY(SampleTruth, "noise_modulation.depth", noise_modulation.depth),
    RINGLOCK_KEY(SampleTruth, "noise_modulation.period_s", noise_modulation.period_s),
    RINGLOCK_KEY(SampleTruth, "bias_per_rate_squared_h_deg", bias_per_rate_squared_h_deg),
    RINGLOCK_KEY(SampleTruth, "late_temperature.deg_h_per_k", late_temperature.deg_h_per_k),
    RINGLOCK_KEY(SampleTruth, "late_temperature.lag_s", late_temperature.lag_s),
    RINGLOCK_KEY(SampleTruth, "slow_acceleration.rms_m_s2", slow_acceleration.rms_m_s2),
    RINGLOCK_KEY(SampleTruth, "slow_acceleration.time_s", slow_acceleration.time_s),
    RINGLOCK_KEY(SampleTruth, "slow_acceleration.deg_h_s2_per_m", slow_acceleration.deg_h_s2_per_m),
};

/// What both kinds of truth have.
template <class T>
constexpr Key<T> shared_numbers[] = {
    RINGLOCK_KEY(T, "temperature.start_c", temperature.start_c),
    RINGLOCK_KEY(T, "temperature.ramp_k_per_h", temperature.ramp_k_per_h),
    RINGLOCK_KEY(T, "temperature.swing_k", temperature.swing_k),
    RINGLOCK_KEY(T, "temperature.period_s", temperature.period_s),
    RINGLOCK_KEY(T, "temperature.interval_s", temperature.interval_s),
    RINGLOCK_KEY(T, "bias_temperature.deg_h_per_k", bias_temperature_deg_h_per_k),
    RINGLOCK_KEY(T, "null_shift_ramp.deg_h_per_k_h", null_shift_deg_h_per_k_h),
    RINGLOCK_KEY(T, "bias_step.step_deg_h", rates.bias_step.step_deg_h),
    RINGLOCK_KEY(T, "bias_step.time_s", rates.bias_step.time_s),
    RINGLOCK_KEY(T, "bias_ramp.deg_h_per_h", rates.bias_ramp_deg_h_per_h),
    RINGLOCK_KEY(T, "bias_instability.deg_h", rates.bias_instability_deg_h),
    RINGLOCK_KEY(T, "rate_random_walk.deg_h_rt_h", rates.rate_random_walk_deg_h_rt_h),
    RINGLOCK_KEY(T, "quantum_noise.deg_rt_h", rates.quantum_noise_deg_rt_h),
    RINGLOCK_KEY(T, "base_vibration.frequency_hz", rates.base_vibration.frequency_hz),
    RINGLOCK_KEY(T, "base_vibration.rate_deg_h", rates.base_vibration.rate_deg_h),
    RINGLOCK_KEY(T, "base_vibration.phase_rad", rates.base_vibration.phase_rad),
    RINGLOCK_KEY(T, "telegraph_bias.step_deg_h", rates.telegraph_bias.step_deg_h),
    RINGLOCK_KEY(T, "telegraph_bias.dwell_s", rates.telegraph_bias.dwell_s),
    RINGLOCK_KEY(T, "settling.start_deg_h", rates.settling.start_deg_h),
    RINGLOCK_KEY(T, "settling.constant_s", rates.settling.constant_s),
    RINGLOCK_KEY(T, "slow_swing.frequency_hz", rates.slow_swing.frequency_hz),
    RINGLOCK_KEY(T, "slow_swing.rate_deg_h", rates.slow_swing.rate_deg_h),
    RINGLOCK_KEY(T, "slow_swing.phase_rad", rates.slow_swing.phase_rad),
    RINGLOCK_KEY(T, "chirped_line.frequency_hz", rates.chirped_line.frequency_hz),
    RINGLOCK_KEY(T, "chirped_line.chirp_hz_per_s", rates.chirped_line.chirp_hz_per_s),
    RINGLOCK_KEY(T, "chirped_line.rate_deg_h", rates.chirped_line.rate_deg_h),
    RINGLOCK_KEY(T, "chirped_line.phase_rad", rates.chirped_line.phase_rad),
};

#undef RINGLOCK_KEY

struct DeclaredKey {
    std::string_view name;
    std::optional<double> record::Declared::*member;
};
constexpr DeclaredKey declared_keys[] = {
    {"declared.scale_factor_arcsec", &record::Declared::scale_factor_arcsec},
    {"declared.lockin_threshold_deg_h", &record::Declared::lockin_threshold_deg_h},
    {"declared.dither_frequency_hz", &record::Declared::dither_frequency_hz},
    {"declared.dither_peak_rate_deg_s", &record::Declared::dither_peak_rate_deg_s},
    {"declared.bias_deg_h", &record::Declared::bias_deg_h},
    {"declared.clock_hz", &record::Declared::clock_hz},
    {"declared.readout_noise_rad", &record::Declared::readout_noise_rad},
    {"declared.input_rate_deg_h", &record::Declared::input_rate_deg_h},
};

[[noreturn]] void refuse(std::string_view key, std::string_view value, const char* allowed) {
    throw InputError(std::string(key) + ": found '" + std::string(value) + "', allowed is " + allowed);
}

double number(std::string_view key, std::string_view text) {
    double x = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
    if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(x)) refuse(key, text, "a number");
    return x;
}

std::uint64_t whole(std::string_view key, std::string_view text) {
    std::uint64_t x = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
    if (error != std::errc{} || end != text.data() + text.size()) refuse(key, text, "a whole number");
    return x;
}

record::Track track(std::string_view key, std::string_view text) {
    record::Track result;
    while (!text.empty()) {
        const std::size_t comma = std::min(text.find(','), text.size());
        const std::string_view row = text.substr(0, comma);
        const std::size_t colon = row.find(':');
        if (colon == std::string_view::npos) refuse(key, row, "time:value");
        result.time_s.push_back(number(key, row.substr(0, colon)));
        result.value.push_back(number(key, row.substr(colon + 1)));
        text.remove_prefix(std::min(comma + 1, text.size()));
    }
    return result;
}

template <class T>
bool set_number(std::span<const Key<T>> keys, T& truth, std::string_view key, std::string_view value) {
    for (const Key<T>& k : keys) {
        if (k.name != key) continue;
        k.value(truth) = number(key, value);
        return true;
    }
    return false;
}

template <class T>
bool set_shared(T& truth, std::string_view key, std::string_view value) {
    if (set_number<T>(shared_numbers<T>, truth, key, value)) return true;
    if (key == "seed") {
        truth.seed = whole(key, value);
        return true;
    }
    for (const DeclaredKey& k : declared_keys) {
        if (k.name != key) continue;
        if (!truth.declared) truth.declared.emplace();
        *truth.declared.*k.member = number(key, value);
        return true;
    }
    return false;
}

template <class T>
void add_names(std::vector<std::string>& names, std::span<const Key<T>> keys) {
    for (const Key<T>& k : keys) names.emplace_back(k.name);
    for (const Key<T>& k : shared_numbers<T>) names.emplace_back(k.name);
    for (const DeclaredKey& k : declared_keys) names.emplace_back(k.name);
}

}  // namespace

std::vector<std::string> turn_keys() {
    std::vector<std::string> names = {"turns", "seed", "input_profile_deg_h"};
    add_names<Truth>(names, turn_numbers);
    return names;
}

std::vector<std::string> sample_keys() {
    std::vector<std::string> names = {
        "size", "seed", "kind", "resampling.of", "case_motion.witness", "accelerometers", "input_profile_deg_h"};
    add_names<SampleTruth>(names, sample_numbers);
    return names;
}

void set(Truth& truth, std::string_view key, std::string_view value) {
    if (set_number<Truth>(turn_numbers, truth, key, value) || set_shared(truth, key, value)) return;
    if (key == "turns") {
        truth.turns = whole(key, value);
    } else if (key == "input_profile_deg_h") {
        truth.input_profile_deg_h = track(key, value);
    } else {
        throw InputError("no parameter of a record of turns is called '" + std::string(key) + "'");
    }
}

void set(SampleTruth& truth, std::string_view key, std::string_view value) {
    if (set_number<SampleTruth>(sample_numbers, truth, key, value) || set_shared(truth, key, value)) return;
    if (key == "size") {
        truth.size = whole(key, value);
    } else if (key == "kind") {
        if (value == "angle_increment_arcsec") {
            truth.kind = record::SampleKind::angle_increment_arcsec;
        } else if (value == "angle_arcsec") {
            truth.kind = record::SampleKind::angle_arcsec;
        } else if (value == "quarter_count") {
            truth.kind = record::SampleKind::quarter_count;
        } else {
            refuse(key, value, "angle_increment_arcsec, angle_arcsec or quarter_count");
        }
    } else if (key == "resampling.of") {
        if (value != "angle" && value != "rate") refuse(key, value, "angle or rate");
        truth.resampling.of_rate = value == "rate";
    } else if (key == "case_motion.witness") {
        truth.case_motion.witness = value;
    } else if (key == "input_profile_deg_h") {
        truth.input_profile_deg_h = track(key, value);
    } else if (key == "accelerometers") {
        if (value != "0" && value != "1") refuse(key, value, "0 or 1");
        truth.accelerometers = value == "1";
    } else {
        throw InputError("no parameter of a record of samples is called '" + std::string(key) + "'");
    }
}

}  // namespace ringlock::test::closure
