#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <string>
#include <string_view>

#include "engine/gyro/setup.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/fast_motion.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

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
                     fmt::format("{} is a property of the instrument, which this readout model leaves out; "
                                 "set readout.model = \"instrument\"",
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

/// Half cycles that are not alike have different accelerations, and meet where the dither itself turns. An input rate
/// moves the turn of the phase away from there: with the meeting point among the four pulses from which the phase at
/// the turn is extrapolated, a parabola through them is wrong by as much as the phases of the two half cycles differ.
Finding pulses_see_one_acceleration(const Scenario& s) {
    constexpr double most_rad = 1.0;
    constexpr double pulses_rad = 2.0 * std::numbers::pi;  // four quarter fringes
    double rate = exposure(s).input_rate_deg_h;
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        rate += bounds.certain.rate_deg_h + sigmas * bounds.rate_sd_deg_h;
    }
    const double asymmetry = largest_asymmetry(s);
    const double least_peak = peak_rate_deg_h(s) * std::max(0.0, 1.0 - asymmetry);
    const double shift_s = std::asin(std::min(1.0, rate / least_peak)) / dither_rad_s(s);
    const double acceleration = phase_amplitude_rad(s) * std::pow(dither_rad_s(s), 2);
    const double window_s = std::sqrt(2.0 * pulses_rad / acceleration);
    const double wrong_rad = 2.0 * asymmetry * acceleration * shift_s * window_s;
    if (wrong_rad <= most_rad) return {};
    for (const Arm& arm : s.arms) {
        if (arm.compensator != Compensator::extrapolated) continue;
        std::vector<std::string> keys =
            with_keys_of_effects(s, {"input.rate_deg_h", "input.sweep_stop_deg_h", "input.profile_rate_deg_h"},
                                 [](const gyro::Setup& a, const gyro::Setup& b) {
                                     return a.dither_asymmetry_ratio != b.dither_asymmetry_ratio;
                                 });
        keys.insert(keys.end(), {"ensemble.dither_asymmetry_sd_ratio", "arms.names"});
        return Complaint{
            std::move(keys),
            fmt::format("arm \"{}\" extrapolates from four pulses, among which the two unlike half cycles "
                        "of the dither meet where the rate is {:g} deg/h: its phases would be wrong by {:.2g} rad, "
                        "and {:g} is the most; make rate or asymmetry smaller, or leave the arm out",
                        arm.name, rate, wrong_rad, most_rad)};
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
            "the phase is a quarter fringe from a turn after {:.3g} s, so that a clock "
            "of {:g} Hz does not resolve the pulses on its two sides, between which the instrument finds the turn; "
            "set readout.clock_hz to {:.3g} or more, or to 0 for continuous time",
            quarter_s, r.clock_hz, least_ticks / quarter_s)};
}

Finding pulses_come_before_the_middle(const Scenario& s) {
    const bool timed =
        s.readout.model == ReadoutModel::instrument || std::any_of(s.arms.begin(), s.arms.end(), follows_pulses);
    if (!timed || pulses_before_middles(s)) return {};
    return Complaint{
        {"gyro.scale_factor_arcsec", "dither.peak_rate_deg_s", "dither.frequency_hz", "gyro.lockin_threshold_deg_h",
         "input.rate_deg_h", "input.sweep_stop_deg_h", "readout.model", "arms.names"},
        "the phase can go through too few quarter fringes between a turn and the middle of a half cycle "
        "for the four pulses on either side of a turn that the electronics time, after input rate, "
        "lock-in and the spread of the gyros have taken their part; set a stronger dither, "
        "or readout.model = \"latched\" without arms that need pulses"};
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
        fmt::format("a bandwidth of {:g} Hz leaves {:.3g} of the fringes' amplitude "
                    "where the dither is fastest ({:g} fringes a second); the bandwidth must exceed that rate, "
                    "and the remaining amplitude must exceed the comparators' hysteresis "
                    "and six sigma of their noise, {:.3g}, or the counter loses fringes",
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
                     fmt::format("comparators with noise of {:g} switch back and forth where the phase is slow; "
                                 "their hysteresis of {:g} must be at least {:g} times the noise",
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

constexpr std::array all_readout_rules = {
    Rule{"An ideal readout has no ellipse to correct.", ideal_detectors_need_no_correction},
    Rule{"Keys that only the instrument has stay at their defaults with other readout models.",
         keys_are_the_instruments},
    Rule{"compensated_extrapolated and compensated_adaptive need the times of pulses, "
         "which the latched readout does not keep.",
         pulses_are_there},
    Rule{"The phases of compensated_extrapolated are right to 1 rad with rate and asymmetry together: "
         "the two half cycles of an asymmetric dither do not meet among its pulses.",
         pulses_see_one_acceleration},
    Rule{"The instrument's clock has two ticks or more in the time from a turn to a quarter fringe.",
         clock_tells_pulses_apart},
    Rule{"Where pulses are timed (by the instrument, or for those arms) "
         "the phase goes through 8 rad from a turn to the middle of the half cycle, even against the lock-in.",
         pulses_come_before_the_middle},
    Rule{"The instrument's bandwidth exceeds the fastest rate of fringes, and the amplitude that remains "
         "at that rate exceeds the hysteresis and six standard deviations of the comparators' noise.",
         comparators_follow_the_fringes},
    Rule{"The instrument's comparators have a hysteresis of at least four standard deviations of their noise.",
         comparators_do_not_chatter},
    Rule{"The instrument's detectors, with six standard deviations of their noise, stay within the converter's range "
         "of 1.25 fringe amplitudes.",
         converter_holds_the_detectors},
};

}  // namespace

std::span<const Rule> readout_rules() { return all_readout_rules; }

}  // namespace ringlock::scenario
