#include "engine/scenario/check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "engine/core/units.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/fast_motion.hpp"
#include "engine/scenario/injected_noise.hpp"

namespace ringlock::scenario {
namespace {

using Finding = std::optional<Complaint>;

double peak_rate_deg_h(const Scenario& s) { return s.dither.peak_rate_deg_s * units::deg_h_per_deg_s; }

double dither_rad_s(const Scenario& s) { return units::two_pi * s.dither.frequency_hz; }

/// Amplitude M = 2 pi Omega_D / (K w_D) of the optical phase under the dither.
double phase_amplitude_rad(const Scenario& s) {
    return units::two_pi * peak_rate_deg_h(s) / (s.gyro.scale_factor_arcsec * dither_rad_s(s));
}

/// Largest first-order kick of one turn, kappa = 2 pi Omega_L / sqrt(K Omega_D w_D).
double kick_rad(const Scenario& s) {
    return units::two_pi * s.gyro.lockin_threshold_deg_h /
           std::sqrt(s.gyro.scale_factor_arcsec * peak_rate_deg_h(s) * dither_rad_s(s));
}

double largest_asymmetry(const Scenario& s) {
    return std::abs(configured_setup(s).dither_asymmetry_ratio) + sigmas * s.ensemble.dither_asymmetry_sd_ratio;
}

/// Keys, then those of the active effects that change the gyro's constants so that `differ(gyro, plain gyro)`.
template <class Differ>
std::vector<std::string> with_keys_of_effects(const Scenario& s, std::vector<std::string> keys, Differ&& differ) {
    for (const auto& [effect, values] : active_effects(s)) {
        gyro::Setup setup;
        effect->configure(*values, setup);
        if (!differ(setup, gyro::Setup{})) continue;
        for (std::string& key : keys_of(*effect)) keys.push_back(std::move(key));
    }
    return keys;
}

/// A rate and the keys that it comes from.
struct RateOfKeys {
    double rate_deg_h;
    std::vector<std::string> keys;
};

/// Keys of all these rates, those of the largest first.
std::vector<std::string> keys_by_rate(std::vector<RateOfKeys> rates) {
    // Stable, so that equal rates keep the order of effects.
    std::stable_sort(rates.begin(), rates.end(),
                     [](const RateOfKeys& a, const RateOfKeys& b) { return a.rate_deg_h > b.rate_deg_h; });
    std::vector<std::string> keys;
    for (const RateOfKeys& rate : rates) keys.insert(keys.end(), rate.keys.begin(), rate.keys.end());
    return keys;
}

Finding dither_reverses_the_rate(const Scenario& s) {
    const double asymmetry = largest_asymmetry(s);
    const double smallest =
        peak_rate_deg_h(s) * (1.0 - sigmas * s.ensemble.dither_amplitude_sd_relative) * (1.0 - asymmetry);
    const double swing = 1.0 - amplitude_change_relative(s.dither, s.ensemble.settle_s + s.ensemble.duration_s);
    for (const double rate : s.input.profile_rate_deg_h) {
        if (std::abs(rate) < 0.5 * smallest * swing) continue;
        return Complaint{{"input.profile_rate_deg_h", "dither.peak_rate_deg_s"},
                         fmt::format("the input rate of {:g} deg/h must stay below {:g} deg/h, half of the smallest "
                                     "peak rate of the dither (the rate must reverse in every half cycle)",
                                     rate, 0.5 * smallest * swing)};
    }
    const bool sweep = s.input.sweep_points > 1;
    const bool stop_is_larger = sweep && std::abs(s.input.sweep_stop_deg_h) > std::abs(s.input.rate_deg_h);
    const double rate = stop_is_larger ? s.input.sweep_stop_deg_h : s.input.rate_deg_h;
    if (std::abs(rate) < 0.5 * smallest) return {};
    std::vector<std::string> keys = with_keys_of_effects(
        s, {stop_is_larger ? "input.sweep_stop_deg_h" : "input.rate_deg_h", "dither.peak_rate_deg_s"},
        [](const gyro::Setup& a, const gyro::Setup& b) {
            return a.dither_asymmetry_ratio != b.dither_asymmetry_ratio;
        });
    keys.insert(keys.end(), {"ensemble.dither_asymmetry_sd_ratio", "ensemble.dither_amplitude_sd_relative"});
    return Complaint{std::move(keys),
                     fmt::format("the input rate of {:g} deg/h must stay below {:g} deg/h, half of the smallest peak "
                                 "rate of the dither (the rate must reverse in every half cycle)",
                                 rate, 0.5 * smallest)};
}

Finding dither_reverses_effects(const Scenario& s) {
    double certain = exposure(s).input_rate_deg_h;
    double random = 0.0;
    std::vector<RateOfKeys> rates;
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        const double rate = bounds.certain.rate_deg_h + sigmas * bounds.rate_sd_deg_h;
        if (rate == 0.0) continue;
        certain += bounds.certain.rate_deg_h;
        random = std::hypot(random, bounds.rate_sd_deg_h);
        rates.push_back({rate, keys_of(*bounds.effect)});
    }
    const double rate = certain + sigmas * random;
    const double swing = 1.0 - amplitude_change_relative(s.dither, s.ensemble.settle_s + s.ensemble.duration_s);
    const double smallest = peak_rate_deg_h(s) * (1.0 - sigmas * s.ensemble.dither_amplitude_sd_relative) *
                            (1.0 - largest_asymmetry(s)) * swing;
    constexpr double most = 0.9;
    if (rates.empty() || rate < most * smallest) return {};
    std::vector<std::string> keys = keys_by_rate(std::move(rates));
    for (const char* key :
         {"environment.temperature_ramp_k_per_h", "environment.temperature_swing_k",
          "environment.profile_temperature_k", "input.profile_rate_deg_h", "input.rate_deg_h", "input.sweep_stop_deg_h",
          "dither.peak_rate_deg_s", "ensemble.duration_s", "ensemble.settle_s"}) {
        keys.emplace_back(key);
    }
    return Complaint{std::move(keys),
                     fmt::format("effects take the rate to as much as {:g} deg/h within {:g} sigma, input included; it "
                                 "must stay below {:g} deg/h, {:g} of the smallest peak rate of the dither (the rate "
                                 "must reverse in every half cycle); make the effects smaller or the run shorter, or "
                                 "set a stronger dither",
                                 rate, sigmas, most * smallest, most)};
}

/// Keys of the rates that matter in comparison with the dither's, that of the largest first.
std::vector<std::string> keys_of_rates(const Scenario& s) {
    std::vector<RateOfKeys> rates;
    rates.push_back({exposure(s).input_rate_deg_h,
                     has_profile(s.input) ? std::vector<std::string>{"input.profile_rate_deg_h"}
                                          : std::vector<std::string>{"input.rate_deg_h", "input.sweep_stop_deg_h"}});
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        const double rate = bounds.certain.rate_deg_h + sigmas * bounds.rate_sd_deg_h;
        if (rate > 0.01 * peak_rate_deg_h(s)) rates.push_back({rate, keys_of(*bounds.effect)});
    }
    return keys_by_rate(std::move(rates));
}

Finding turns_are_reached(const Scenario& s) {
    // 20000 steps of an eighth of a radian are 2500 rad, see zero_rate-inl.hpp.
    constexpr double most_rad = 2250.0;
    const double way_rad = way_to_turns_rad(s);
    if (way_rad <= most_rad) return {};
    std::vector<std::string> keys = keys_of_rates(s);
    for (const char* key : {"dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.scale_factor_arcsec"}) {
        keys.emplace_back(key);
    }
    return Complaint{
        std::move(keys),
        fmt::format("input rate and effects move the turn of the phase away from that of the dither by up "
                    "to {:.4g} rad of phase, and the readout follows it for {:g} rad; lower the input rate "
                    "or the effects, or set another dither or scale factor that makes fewer fringes",
                    way_rad, most_rad)};
}

Finding amplitude_stays(const Scenario& s) {
    constexpr double most = 0.5;
    const double change = amplitude_change_relative(s.dither, s.ensemble.settle_s + s.ensemble.duration_s);
    if (change <= most) return {};
    return Complaint{{"dither.amplitude_wander_relative_rt_s", "dither.amplitude_drift_relative_per_h",
                      "ensemble.duration_s", "ensemble.settle_s"},
                     fmt::format("the dither's amplitude changes by up to {:g} of itself; it must not change by more "
                                 "than {:g} within {:g} sigma",
                                 change, most, sigmas)};
}

/// As many values as times, in order of time.
Finding wrong_profile(const std::vector<double>& times, const std::vector<double>& values, const std::string& time_key,
                      const std::string& value_key, const char* what) {
    if (times.size() != values.size()) {
        return Complaint{
            {value_key, time_key},
            fmt::format("a profile of {} times has as many {}, not {}", times.size(), what, values.size())};
    }
    for (std::size_t i = 1; i < times.size(); ++i) {
        if (times[i] > times[i - 1]) continue;
        return Complaint{
            {time_key},
            fmt::format("{:g} s comes after {:g} s; times of a profile must increase", times[i], times[i - 1])};
    }
    return {};
}

Finding temperatures_are_a_profile(const Scenario& s) {
    const Environment& e = s.environment;
    if (auto wrong = wrong_profile(e.profile_time_s, e.profile_temperature_k, "environment.profile_time_s",
                                   "environment.profile_temperature_k", "temperatures")) {
        return wrong;
    }
    if (e.profile_time_s.empty() || (e.temperature_ramp_k_per_h == 0.0 && e.temperature_swing_k == 0.0)) return {};
    return Complaint{
        {"environment.profile_time_s", "environment.temperature_ramp_k_per_h", "environment.temperature_swing_k"},
        "a temperature that follows a profile has no ramp and no swing; leave them out, or the profile"};
}

Finding profile_is_a_profile(const Scenario& s) {
    const auto& times = s.input.profile_time_s;
    if (auto wrong = wrong_profile(times, s.input.profile_rate_deg_h, "input.profile_time_s",
                                   "input.profile_rate_deg_h", "rates")) {
        return wrong;
    }
    if (times.empty() || s.input.sweep_points == 1) return {};
    return Complaint{{"input.profile_time_s", "input.sweep_points"},
                     "a rate that follows a profile cannot be swept; leave out one of the two"};
}

Finding sweep_goes_somewhere(const Scenario& s) {
    if (s.input.sweep_points == 1 || s.input.sweep_stop_deg_h != s.input.rate_deg_h) return {};
    return Complaint{{"input.sweep_points", "input.sweep_stop_deg_h"},
                     fmt::format("a sweep of {} points must end at another rate than it starts from ({:g} deg/h); set "
                                 "input.sweep_stop_deg_h",
                                 s.input.sweep_points, s.input.rate_deg_h)};
}

Finding sweep_is_not_too_large(const Scenario& s) {
    constexpr std::int64_t most = 100'000'000;
    if (s.input.sweep_points * s.ensemble.gyros <= most) return {};
    return Complaint{{"ensemble.gyros", "input.sweep_points"},
                     fmt::format("{} gyros at each of {} rates are more than the {} gyros that a run can hold",
                                 s.ensemble.gyros, s.input.sweep_points, most)};
}

Finding turns_can_be_counted(const Scenario& s) {
    // A gyro has two trajectories at most, and twice this fits 64 bits.
    constexpr double most = 1e18;
    const double simulated_s = s.ensemble.settle_s + s.ensemble.duration_s;
    const double half_cycles = static_cast<double>(s.ensemble.gyros) * static_cast<double>(s.input.sweep_points) *
                               simulated_s * 2.0 * s.dither.frequency_hz;
    if (half_cycles <= most) return {};
    return Complaint{
        {"ensemble.duration_s", "ensemble.settle_s", "ensemble.gyros", "dither.frequency_hz", "input.sweep_points"},
        fmt::format(
            "{:.3g} half cycles of the dither, of all gyros together, are more than the {:g} that a run can hold",
            half_cycles, most)};
}

Finding turn_map_has_fringes(const Scenario& s) {
    constexpr double fewest = 10.0;
    const double fringes = phase_amplitude_rad(s) / units::pi;
    if (s.propagation.method != PropagationMethod::turn_map || fringes >= fewest) return {};
    return Complaint{
        {"dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.scale_factor_arcsec", "propagation.method"},
        fmt::format("{:.3g} fringes in a half cycle of the dither; the turn map needs at least {:g} (turns "
                    "must be far apart in phase); set propagation.method = \"direct\" or a stronger dither",
                    fringes, fewest)};
}

Finding turn_map_has_small_kicks(const Scenario& s) {
    constexpr double largest = 1.0;
    const double kick = kick_rad(s);
    if (s.propagation.method != PropagationMethod::turn_map || kick < largest) return {};
    return Complaint{
        {"gyro.lockin_threshold_deg_h", "dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.scale_factor_arcsec",
         "propagation.method"},
        fmt::format("lock-in moves the phase by up to {:.3g} rad at a turn; the turn map needs less than {:g} "
                    "rad; set propagation.method = \"direct\" or a stronger dither",
                    kick, largest)};
}

/// What a scenario whose turn map does not exist, or cannot be tabulated, can do instead.
std::string way_without_tables(const Scenario& s) {
    return s.propagation.method == PropagationMethod::turn_map
               ? "set propagation.method = \"direct\""
               : "leave out the arms with compensated_exact and compensated_adaptive, which invert the turn map";
}

Finding turn_map_has_fast_middles(const Scenario& s) {
    if (!amplitude_loop_is_stable(s) || fast_middles(s)) return {};
    std::vector<std::string> keys = keys_of_rates(s);
    for (const char* key :
         {"noise_injection.turn_phase_rms_rad", "dither.peak_rate_deg_s", "dither.frequency_hz",
          "gyro.scale_factor_arcsec", "gyro.lockin_threshold_deg_h", "calibration.threshold_error_relative",
          "ensemble.dither_amplitude_sd_relative", "ensemble.dither_asymmetry_sd_ratio",
          "ensemble.lockin_threshold_sd_relative", "arms.names", "propagation.method"}) {
        keys.emplace_back(key);
    }
    return Complaint{
        std::move(keys),
        fmt::format("the phase can go through too few fringes between a zero-rate point and the middle of a half cycle "
                    "for the turn map, which needs 10 rad there, after injected noise, effects and the spread of the "
                    "gyros have taken their part; {} or a stronger dither",
                    way_without_tables(s))};
}

Finding turn_map_has_narrow_tables(const Scenario& s) {
    if (!amplitude_loop_is_stable(s) || tables_hold_the_tolerance(s)) return {};
    std::vector<std::string> keys = keys_of_rates(s);
    for (const char* key : {"noise_injection.turn_phase_rms_rad", "noise_injection.drive_noise_relative",
                            "dither.amplitude_wander_relative_rt_s", "dither.amplitude_drift_relative_per_h",
                            "propagation.turn_map_tolerance_rad", "dither.peak_rate_deg_s", "dither.frequency_hz",
                            "gyro.scale_factor_arcsec", "arms.names", "propagation.method"}) {
        keys.emplace_back(key);
    }
    return Complaint{
        std::move(keys),
        fmt::format("the tables of the turn map cannot hold a tolerance of {:g} rad over the amplitudes and rates that "
                    "they must cover: at a high input rate the phase at which the rate reverses moves by many radians "
                    "with either (docs/turn-map.md); lower the input rate, or what makes rate and amplitude vary, "
                    "raise propagation.turn_map_tolerance_rad or {}",
                    s.propagation.turn_map_tolerance_rad, way_without_tables(s))};
}

bool an_arm_injects_noise(const Scenario& s) {
    return std::any_of(s.arms.begin(), s.arms.end(), [](const Arm& arm) { return arm.noise_injected; });
}

Finding loop_must_be_stable(const Scenario& s) {
    if (amplitude_loop_is_stable(s)) return {};
    return Complaint{
        {"noise_injection.amplitude_loop_hz", "noise_injection.resonator_q", "dither.frequency_hz"},
        "the amplitude loop is not stable: it corrects the force once in a half cycle and must be slow beside "
        "that; a hundredth of the dither's frequency is"};
}

Finding drive_forgets_in_time(const Scenario& s) {
    if (s.noise_injection.model != NoiseModel::drive || !amplitude_loop_is_stable(s)) return {};
    constexpr double most = 2e6;  // some seconds of a block of gyros
    const double settling = gyro::Resonator(drive_noise(s)).settling_half_cycles();
    if (settling <= most) return {};
    return Complaint{
        {"noise_injection.amplitude_loop_hz", "noise_injection.resonator_q", "dither.frequency_hz"},
        fmt::format("resonator and amplitude loop forget a deviation in {:.3g} half cycles, which every gyro goes "
                    "through before its run; at most {:g} are allowed: set a faster loop, none (0), or a lower "
                    "resonator_q",
                    settling, most)};
}

Finding noise_has_one_strength(const Scenario& s) {
    const NoiseInjection& noise = s.noise_injection;
    if (noise.drive_noise_relative == 0.0) return {};
    if (noise.turn_phase_rms_rad != 0.0) {
        return Complaint{
            {"noise_injection.drive_noise_relative"},
            "the strength of the noise is given twice, here and by noise_injection.turn_phase_rms_rad; leave "
            "one of them out"};
    }
    if (noise.model == NoiseModel::drive) return {};
    return Complaint{
        {"noise_injection.drive_noise_relative"},
        "noise of a drive needs noise_injection.model = \"drive\"; the model \"turns\" has its strength from "
        "noise_injection.turn_phase_rms_rad"};
}

Finding keys_of_a_drive_need_it(const Scenario& s) {
    const NoiseInjection& noise = s.noise_injection;
    const NoiseInjection plain;
    if (noise.model == NoiseModel::drive) return {};
    const auto needless = [](const char* key) {
        return Complaint{{std::string("noise_injection.") + key},
                         "has a meaning with noise_injection.model = \"drive\" only; set that, or leave the key out"};
    };
    if (noise.resonator_q != plain.resonator_q) return needless("resonator_q");
    if (noise.form != plain.form) return needless("form");
    if (noise.distribution != plain.distribution) return needless("distribution");
    if (noise.hold_half_cycles != plain.hold_half_cycles) return needless("hold_half_cycles");
    if (noise.modulation_hz != plain.modulation_hz) return needless("modulation_hz");
    if (noise.amplitude_loop_hz != plain.amplitude_loop_hz) return needless("amplitude_loop_hz");
    return {};
}

Finding sinusoidal_noise_is_slow(const Scenario& s) {
    const NoiseInjection& noise = s.noise_injection;
    if (noise.model != NoiseModel::drive || noise.form != gyro::NoiseForm::sinusoidal) return {};
    if (noise.modulation_hz < s.dither.frequency_hz) return {};
    return Complaint{{"noise_injection.modulation_hz", "dither.frequency_hz"},
                     fmt::format("the modulation must be slower than the dither, {:g} Hz", s.dither.frequency_hz)};
}

Finding changing_amplitudes_need_moebius_maps(const Scenario& s) {
    const NoiseInjection& noise = s.noise_injection;
    if (!an_arm_injects_noise(s) || noise.model != NoiseModel::drive || noise.form == gyro::NoiseForm::white) return {};
    if (s.propagation.method != PropagationMethod::turn_map || configured_setup(s).lockin_second_ratio == 0.0)
        return {};
    return Complaint{
        {"noise_injection.model", "noise_injection.form", "propagation.method"},
        "the turn map does not have a second harmonic of the coupling together with an amplitude that changes "
        "over half cycles; set propagation.method = \"direct\", or leave the effect out"};
}

Finding noise_leaves_the_dither(const Scenario& s) {
    if (!an_arm_injects_noise(s) || !amplitude_loop_is_stable(s)) return {};
    // Eight standard deviations of the amplitude leave half of it.
    const InjectedNoise noise = injected_noise(s);
    const double half_swing_rad = 0.5 * phase_amplitude_rad(s);
    if (noise.margin_rad <= half_swing_rad) return {};
    const double most_rad = noise.turn_rms_rad * half_swing_rad / noise.margin_rad;
    const bool relative = s.noise_injection.drive_noise_relative > 0.0;
    const std::string most =
        relative
            ? fmt::format("{:.4g} of the force", s.noise_injection.drive_noise_relative * most_rad / noise.turn_rms_rad)
            : fmt::format("{:.4g} rad", most_rad);
    return Complaint{
        {relative ? "noise_injection.drive_noise_relative" : "noise_injection.turn_phase_rms_rad",
         "dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.scale_factor_arcsec"},
        fmt::format("noise of {:.4g} rad at the turns must not exceed {} (eight standard deviations of a half cycle's "
                    "amplitude must leave half of it)",
                    noise.turn_rms_rad, most)};
}

Finding effects_leave_a_threshold(const Scenario& s) {
    constexpr double most = 0.9;
    const double change = threshold_change_relative(s);
    if (change <= most) return {};
    std::vector<std::string> keys;
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        if (bounds.certain.threshold_relative == 0.0) continue;
        for (std::string& key : keys_of(*bounds.effect)) keys.push_back(std::move(key));
    }
    keys.insert(keys.end(), {"environment.temperature_ramp_k_per_h", "environment.temperature_swing_k",
                             "environment.profile_temperature_k", "ensemble.duration_s", "ensemble.settle_s"});
    return Complaint{std::move(keys),
                     fmt::format("the temperature changes by up to {:g} K, the threshold by {:g} of itself; it must "
                                 "not change by more than {:g}",
                                 exposure(s).temperature_change_k, change, most)};
}

Finding ideal_detectors_need_no_correction(const Scenario& s) {
    if (s.readout.model != ReadoutModel::ideal || !s.readout.ellipse_correction) return {};
    return Complaint{{"readout.ellipse_correction", "readout.model"},
                     "an ideal readout has no ellipse to correct; set readout.model = \"latched\" or \"instrument\""};
}

Finding keys_are_the_instruments(const Scenario& s) {
    static const Readout standard;
    if (s.readout.model == ReadoutModel::instrument) return {};
    const Readout& r = s.readout;
    std::string_view key;
    if (r.phase_from != standard.phase_from) key = "readout.phase_from";
    if (r.comparator_noise_relative != standard.comparator_noise_relative) key = "readout.comparator_noise_relative";
    if (r.comparator_hysteresis_relative != standard.comparator_hysteresis_relative) {
        key = "readout.comparator_hysteresis_relative";
    }
    if (r.detector_bandwidth_hz != standard.detector_bandwidth_hz) key = "readout.detector_bandwidth_hz";
    if (r.adc_bits != standard.adc_bits) key = "readout.adc_bits";
    if (key.empty()) return {};
    return Complaint{{std::string(key), "readout.model"},
                     fmt::format("{} is a property of the instrument, which this readout model leaves out; set "
                                 "readout.model = \"instrument\"",
                                 key)};
}

bool follows_pulses(const Arm& arm) {
    return arm.compensator == Compensator::extrapolated || arm.compensator == Compensator::adaptive;
}

Finding pulses_are_there(const Scenario& s) {
    if (s.readout.model != ReadoutModel::latched) return {};
    for (const Arm& arm : s.arms) {
        if (!follows_pulses(arm)) continue;
        return Complaint{
            {"arms.names", "readout.model"},
            fmt::format("arm \"{}\" needs the pulses' times; set readout.model = \"instrument\"", arm.name)};
    }
    return {};
}

Finding clock_tells_pulses_apart(const Scenario& s) {
    constexpr double least_ticks = 2.0;
    const Readout& r = s.readout;
    if (r.model != ReadoutModel::instrument || r.clock_hz == 0.0) return {};
    // From a turn on, the phase goes through a quarter fringe in sqrt(pi/a).
    const double spread = (1.0 + sigmas * s.ensemble.dither_amplitude_sd_relative) * (1.0 + largest_asymmetry(s));
    const double acceleration = phase_amplitude_rad(s) * spread * std::pow(dither_rad_s(s), 2);
    const double quarter_s = std::sqrt(std::numbers::pi / acceleration);
    if (r.clock_hz * quarter_s >= least_ticks) return {};
    return Complaint{
        {"readout.clock_hz", "dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.scale_factor_arcsec",
         "readout.model"},
        fmt::format(
            "the phase is a quarter fringe from a turn after {:.3g} s, so that a clock of {:g} Hz does not tell "
            "the pulses on its two sides apart, between which the instrument finds the turn; set "
            "readout.clock_hz to {:.3g} or more, or to 0 for continuous time",
            quarter_s, r.clock_hz, least_ticks / quarter_s)};
}

Finding pulses_come_before_the_middle(const Scenario& s) {
    const bool timed =
        s.readout.model == ReadoutModel::instrument || std::any_of(s.arms.begin(), s.arms.end(), follows_pulses);
    if (!timed || pulses_before_middles(s)) return {};
    return Complaint{
        {"gyro.scale_factor_arcsec", "dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.lockin_threshold_deg_h",
         "input.rate_deg_h", "input.sweep_stop_deg_h", "readout.model", "arms.names"},
        "the phase can go through too few quarter fringes between a turn and the middle of a half cycle for the four "
        "pulses on either side of a turn that the electronics time, after input rate, lock-in and the spread of the "
        "gyros have taken their part; set a stronger dither, or readout.model = \"latched\" without arms that need "
        "pulses"};
}

/// Largest rate of the phase in fringes a second: the dither's, with its spread, and the input.
double peak_beat_hz(const Scenario& s) {
    const double spread = 1.0 + sigmas * s.ensemble.dither_amplitude_sd_relative;
    return (peak_rate_deg_h(s) * spread * (1.0 + largest_asymmetry(s)) + exposure(s).input_rate_deg_h) /
           s.gyro.scale_factor_arcsec;
}

Finding comparators_follow_the_fringes(const Scenario& s) {
    const Readout& r = s.readout;
    if (r.model != ReadoutModel::instrument || r.detector_bandwidth_hz == 0.0) return {};
    const double beat = peak_beat_hz(s);
    const double left = 1.0 / std::hypot(1.0, beat / r.detector_bandwidth_hz);
    const double needed = r.comparator_hysteresis_relative + sigmas * r.comparator_noise_relative;
    if (left > needed && r.detector_bandwidth_hz > beat) return {};
    return Complaint{
        {"readout.detector_bandwidth_hz", "dither.peak_rate_deg_s", "gyro.scale_factor_arcsec",
         "readout.comparator_hysteresis_relative", "readout.comparator_noise_relative"},
        fmt::format("a bandwidth of {:g} Hz leaves {:.3g} of the fringes' amplitude where the dither is fastest ({:g} "
                    "fringes a second); the bandwidth must exceed that rate, and what is left the comparators' "
                    "hysteresis and six sigma of their noise, {:.3g}, or the counter loses fringes",
                    r.detector_bandwidth_hz, left, beat, needed)};
}

Finding comparators_do_not_chatter(const Scenario& s) {
    const Readout& r = s.readout;
    constexpr double least = 4.0;
    if (r.model != ReadoutModel::instrument ||
        r.comparator_hysteresis_relative >= least * r.comparator_noise_relative) {
        return {};
    }
    return Complaint{{"readout.comparator_hysteresis_relative", "readout.comparator_noise_relative"},
                     fmt::format("comparators with noise of {:g} switch back and forth where the phase is slow; their "
                                 "hysteresis of {:g} must be at least {:g} times the noise",
                                 r.comparator_noise_relative, r.comparator_hysteresis_relative, least)};
}

Finding converter_holds_the_detectors(const Scenario& s) {
    constexpr double range = 1.25;
    const gyro::Ellipse ellipse = configured_setup(s).ellipse;
    const double largest =
        std::max(1.0 + ellipse.gain + std::abs(ellipse.offset_sin), 1.0 + std::abs(ellipse.offset_cos)) +
        sigmas * s.readout.detector_noise_relative;
    if (s.readout.model != ReadoutModel::instrument || s.readout.adc_bits == 0 || largest <= range) return {};
    return Complaint{
        with_keys_of_effects(s, {"readout.adc_bits", "readout.detector_noise_relative"},
                             [](const gyro::Setup& a, const gyro::Setup& b) { return !(a.ellipse == b.ellipse); }),
        fmt::format("the detectors reach {:.3g} fringe amplitudes, the converter holds {:g}", largest, range)};
}

Finding sample_holds_a_cycle(const Scenario& s) {
    const double cycle = 1.0 / s.dither.frequency_hz;
    if (s.output.sample_interval_s >= cycle) return {};
    return Complaint{{"output.sample_interval_s", "dither.frequency_hz"},
                     fmt::format("samples every {:g} s must be at least one dither cycle apart, {:.6g} s",
                                 s.output.sample_interval_s, cycle)};
}

/// Dither cycles of the longest averaging time: an Allan deviation needs two of it, and the record is of whole samples
/// of whole cycles.
double longest_average_cycles(const Scenario& s) {
    const double frequency = s.dither.frequency_hz;
    const double sample_cycles = std::max(1.0, std::round(s.output.sample_interval_s * frequency));
    const double samples = std::floor(s.ensemble.duration_s * frequency / sample_cycles + 1e-9);
    return std::floor(0.5 * samples * sample_cycles);
}

bool has_deviation_at(const Scenario& s, double tau_s) {
    const double cycles = std::round(tau_s * s.dither.frequency_hz);
    return cycles >= 1.0 && cycles <= longest_average_cycles(s);
}

std::string deviations_text(const Scenario& s) {
    return fmt::format("there are Allan deviations from {:.4g} s (a dither cycle) to {:.6g} s (half of the record)",
                       1.0 / s.dither.frequency_hz, longest_average_cycles(s) / s.dither.frequency_hz);
}

Finding averaging_times_fit(const Scenario& s) {
    constexpr std::size_t most = 100;
    if (s.output.tau_s.size() > most) {
        return Complaint{
            {"output.tau_s"},
            fmt::format("has {} averaging times; at most {} can be asked for", s.output.tau_s.size(), most)};
    }
    for (const double tau_s : s.output.tau_s) {
        if (has_deviation_at(s, tau_s)) continue;
        return Complaint{{"output.tau_s", "ensemble.duration_s", "dither.frequency_hz"},
                         fmt::format("an averaging time of {:g} s is not there: {}", tau_s, deviations_text(s))};
    }
    return {};
}

Finding specification_can_be_met(const Scenario& s) {
    const Specification& wanted = s.specification;
    if (wanted.bias_stability_deg_h > 0.0 && !has_deviation_at(s, wanted.at_s)) {
        return Complaint{{"specification.at_s", "specification.bias_stability_deg_h", "ensemble.duration_s"},
                         fmt::format("an averaging time of {:g} s is not there: {}", wanted.at_s, deviations_text(s))};
    }
    if (wanted.angle_error_arcsec > 0.0 && wanted.after_s > s.ensemble.duration_s) {
        return Complaint{{"specification.after_s", "specification.angle_error_arcsec", "ensemble.duration_s"},
                         fmt::format("the record ends after {:g} s; ask for an earlier time or set a longer "
                                     "ensemble.duration_s",
                                     s.ensemble.duration_s)};
    }
    double white = 0.0;
    std::vector<std::string> keys{"specification.arw_deg_rt_h"};
    for (const auto& [effect, values] : active_effects(s)) {
        const double density = effect->rate_noise(*values).white_deg2_h2_s;
        if (!(density > 0.0)) continue;
        white += density;
        const auto more = keys_of(*effect);
        keys.insert(keys.end(), more.begin(), more.end());
    }
    const double declared = std::sqrt(white) * units::deg_rt_h_per_arcsec_rt_s;
    if (wanted.arw_deg_rt_h == 0.0 || wanted.arw_deg_rt_h > declared) return {};
    return Complaint{
        std::move(keys),
        fmt::format("no arm can meet it: effects alone make a random walk of {:.4g} deg/sqrt(h)", declared)};
}

Finding run_holds_samples(const Scenario& s) {
    constexpr double fewest = 3.0;
    if (s.ensemble.duration_s >= fewest * s.output.sample_interval_s) return {};
    return Complaint{
        {"ensemble.duration_s", "output.sample_interval_s"},
        fmt::format("a run of {:g} s must hold at least {:g} samples of {:g} s each (an Allan deviation needs "
                    "them)",
                    s.ensemble.duration_s, fewest, s.output.sample_interval_s)};
}

struct Rule {
    std::string_view doc;
    Finding (*find)(const Scenario&);
};

constexpr std::array all_rules = {
    Rule{"The input rate, over the whole sweep, stays below half of the dither's smallest peak rate (six standard "
         "deviations of its spread and the asymmetry taken off), so that the rate reverses in every half cycle.",
         dither_reverses_the_rate},
    Rule{"Input rate and effects together, six standard deviations of random rates taken, stay below 0.9 of that peak "
         "rate over the run.",
         dither_reverses_effects},
    Rule{"Input rate and effects move the turn of the phase away from that of the dither by no more than 2250 rad of "
         "phase: so far the readout follows it.",
         turns_are_reached},
    Rule{"Wander and drift of the dither's amplitude stay within half of it over the run, six standard deviations "
         "taken.",
         amplitude_stays},
    Rule{"A profile of the input rate has as many times as rates, in order of time, and there is no sweep beside it.",
         profile_is_a_profile},
    Rule{"A profile of the temperature has as many times as temperatures, in order of time, and neither ramp nor swing "
         "beside it.",
         temperatures_are_a_profile},
    Rule{"A sweep of more than one point ends at another rate than it starts from.", sweep_goes_somewhere},
    Rule{"The gyros of all points of the sweep are at most 100000000.", sweep_is_not_too_large},
    Rule{"The half cycles of all gyros, those before the record with them, are at most 1e18.", turns_can_be_counted},
    Rule{"The turn map needs at least 10 fringes in a half cycle: 2 Omega_D / (K w_D) >= 10.", turn_map_has_fringes},
    Rule{"The turn map needs kicks below 1 rad: 2 pi Omega_L / sqrt(K Omega_D w_D) < 1.", turn_map_has_small_kicks},
    Rule{
        "The turn map needs a phase that goes through at least 10 rad from a zero-rate point to the middle of the half "
        "cycle, and a rate there of at least 4 b (b: coupling), after rates, injected noise, effects, the spread of "
        "the gyros and the room of the tables have taken their part (docs/turn-map.md).",
        turn_map_has_fast_middles},
    Rule{"The tables of the turn map hold turn_map_tolerance_rad, by an estimate on the safe side, over the rates of "
         "128 turns and the amplitudes that noise, wander and drift make: the wider these and the higher the input "
         "rate, the more terms it takes (docs/turn-map.md).",
         turn_map_has_narrow_tables},
    Rule{"Injected noise leaves at least half of each half cycle's swing within eight standard deviations "
         "(checked where an arm injects noise).",
         noise_leaves_the_dither},
    Rule{"The strength of injected noise is given once: by turn_phase_rms_rad, or for a drive by drive_noise_relative.",
         noise_has_one_strength},
    Rule{"Keys of a drive's noise need model = \"drive\".", keys_of_a_drive_need_it},
    Rule{"The amplitude loop of a drive is stable.", loop_must_be_stable},
    Rule{"Resonator and amplitude loop of a drive forget a deviation to 1e-9 within 2e6 half cycles.",
         drive_forgets_in_time},
    Rule{"A sinusoidal modulation of the drive is slower than the dither.", sinusoidal_noise_is_slow},
    Rule{"The turn map has no second harmonic of the coupling together with held or sinusoidal noise of a drive.",
         changing_amplitudes_need_moebius_maps},
    Rule{"Effects change the lock-in threshold by no more than 0.9 of itself over the run.", effects_leave_a_threshold},
    Rule{"An ideal readout has no ellipse to correct.", ideal_detectors_need_no_correction},
    Rule{"Keys that only the instrument has stay at their defaults with other readout models.",
         keys_are_the_instruments},
    Rule{"compensated_extrapolated and compensated_adaptive need the times of pulses, which the latched readout does "
         "not keep.",
         pulses_are_there},
    Rule{"The instrument's clock has two ticks or more in the time from a turn to a quarter fringe.",
         clock_tells_pulses_apart},
    Rule{
        "Where pulses are timed (by the instrument, or for those arms) the phase goes through 8 rad from a turn to the "
        "middle of the half cycle, even against the lock-in.",
        pulses_come_before_the_middle},
    Rule{
        "The instrument's bandwidth exceeds the fastest rate of fringes, and leaves there more of their amplitude than "
        "hysteresis and six standard deviations of the comparators' noise.",
        comparators_follow_the_fringes},
    Rule{"The instrument's comparators have a hysteresis of at least four standard deviations of their noise.",
         comparators_do_not_chatter},
    Rule{"The instrument's detectors, with six standard deviations of their noise, stay within the converter's range "
         "of 1.25 fringe amplitudes.",
         converter_holds_the_detectors},
    Rule{"A sample of the output is at least one dither cycle long.", sample_holds_a_cycle},
    Rule{"A run holds at least three samples.", run_holds_samples},
    Rule{"Averaging times asked for (at most 100) are between a dither cycle and half of the record.",
         averaging_times_fit},
    Rule{"A specification asks for averaging and other times that the record has, and for no less random walk than "
         "effects make by themselves.",
         specification_can_be_met},
};

}  // namespace

std::vector<Complaint> check(const Scenario& scenario) {
    std::vector<Complaint> complaints;
    for (const Rule& rule : all_rules) {
        if (Finding finding = rule.find(scenario)) complaints.push_back(std::move(*finding));
    }
    return complaints;
}

std::vector<std::string_view> rules() {
    std::vector<std::string_view> docs;
    for (const Rule& rule : all_rules) docs.push_back(rule.doc);
    return docs;
}

}  // namespace ringlock::scenario
