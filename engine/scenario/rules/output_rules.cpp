#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/units.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

Finding sample_holds_a_cycle(const Scenario& s) {
    const double cycle = 1.0 / s.dither.frequency_hz;
    if (s.output.sample_interval_s >= cycle) return {};
    return Complaint{{"output.sample_interval_s", "dither.frequency_hz"},
                     fmt::format("samples every {:g} s must be at least one dither cycle apart, {:.6g} s",
                                 s.output.sample_interval_s, cycle)};
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

Finding angle_times_fit(const Scenario& s) {
    constexpr std::size_t most = 100;
    if (s.output.angle_after_s.size() > most) {
        return Complaint{{"output.angle_after_s"},
                         fmt::format("has {} times; at most {} can be asked for", s.output.angle_after_s.size(), most)};
    }
    for (const double after_s : s.output.angle_after_s) {
        if (after_s <= s.ensemble.duration_s) continue;
        return Complaint{{"output.angle_after_s", "ensemble.duration_s"},
                         fmt::format("the record ends after {:g} s, before {:g} s", s.ensemble.duration_s, after_s)};
    }
    return {};
}

Finding specification_can_be_met(const Scenario& s) {
    const Specification& wanted = s.specification;
    if (wanted.bias_stability_deg_h > 0.0 && !has_deviation_at(s, wanted.at_s)) {
        return Complaint{{"specification.at_s", "specification.bias_stability_deg_h", "ensemble.duration_s"},
                         fmt::format("an averaging time of {:g} s is not there: {}", wanted.at_s, deviations_text(s))};
    }
    constexpr double fewest_increments = 32.0;  // of a record that a random walk is fitted to, noise::Options
    if (wanted.arw_deg_rt_h > 0.0 && s.ensemble.duration_s < fewest_increments * s.output.sample_interval_s) {
        return Complaint{
            {"specification.arw_deg_rt_h", "ensemble.duration_s", "output.sample_interval_s"},
            fmt::format("no arm can show that it meets it: a random walk is fitted to {:g} samples or "
                        "more, and the record has {:.0f}; set a longer ensemble.duration_s or a shorter "
                        "output.sample_interval_s",
                        fewest_increments, std::floor(s.ensemble.duration_s / s.output.sample_interval_s))};
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

Finding scale_factor_has_a_sweep(const Scenario& s) {
    constexpr std::int64_t fewest_rates = 3;  // of a line that says how far it is off, as in study::scale_factor
    if (s.specification.scale_factor_error_ppm == 0.0 || s.input.sweep_points >= fewest_rates) return {};
    return Complaint{{"specification.scale_factor_error_ppm", "input.sweep_points"},
                     fmt::format("a scale factor error is that of a straight line through the rates of a sweep, and "
                                 "input.sweep_points = {}; set input.sweep_points to {} or more and "
                                 "input.sweep_stop_deg_h to the last rate, or leave the limit out (0)",
                                 s.input.sweep_points, fewest_rates)};
}

constexpr std::array all_output_rules = {
    Rule{"A sample of the output is at least one dither cycle long.", sample_holds_a_cycle},
    Rule{"A run holds at least three samples.", run_holds_samples},
    Rule{"Averaging times asked for (at most 100) are between a dither cycle and half of the record.",
         averaging_times_fit},
    Rule{"Times asked for angles (at most 100) are within the record.", angle_times_fit},
    Rule{"A specification asks for averaging and other times that the record has, for no less random walk than effects "
         "make by themselves, and for one of records of 32 samples or more only.",
         specification_can_be_met},
    Rule{"A specification of the scale factor error is one of a sweep of three rates or more.",
         scale_factor_has_a_sweep},
};

}  // namespace

std::span<const Rule> output_rules() { return all_output_rules; }

}  // namespace ringlock::scenario
