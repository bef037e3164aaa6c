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
#include "engine/scenario/read_arms.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

/// One step from output to output, in messages.
const char* output_name(const Scenario& s) { return reads_arms(s) ? "output of the reader" : "dither cycle"; }

/// Key that sets the time from one to the next.
std::string output_key(const Scenario& s) { return reads_arms(s) ? "reader.output_hz" : "dither.frequency_hz"; }

Finding sample_holds_an_output(const Scenario& s) {
    if (s.output.sample_interval_s >= 1.0 / outputs_hz(s)) return {};
    return Complaint{{"output.sample_interval_s", output_key(s)},
                     fmt::format("samples every {:g} s must be at least one {} apart, {:.6g} s",
                                 s.output.sample_interval_s, output_name(s), 1.0 / outputs_hz(s))};
}

constexpr double fewest_samples = 3.0;

Finding run_holds_samples(const Scenario& s) {
    if (s.ensemble.duration_s >= fewest_samples * s.output.sample_interval_s) return {};
    return Complaint{
        {"ensemble.duration_s", "output.sample_interval_s"},
        fmt::format("a run of {:g} s must hold at least {:g} samples of {:g} s each (an Allan deviation needs them)",
                    s.ensemble.duration_s, fewest_samples, s.output.sample_interval_s)};
}

Finding run_outlasts_the_reader(const Scenario& s) {
    const double fit_s = least_fit_interval_s(s);
    if (s.ensemble.duration_s >= fewest_samples * fit_s) return {};
    return Complaint{
        {"ensemble.duration_s", "reader.output_hz", "reader.fir_order", "reader.stripping"},
        fmt::format("noise coefficients are fitted to samples no closer than a dither cycle "
                    "and ten times the length of the reader's filter (docs/reader.md), here {:.4g} s, and a run "
                    "of {:g} s does not hold {:g} of them; set a longer ensemble.duration_s or a shorter filter",
                    fit_s, s.ensemble.duration_s, fewest_samples)};
}

/// Outputs of the longest averaging time: an Allan deviation needs two of it, and the record is of whole samples of
/// whole outputs.
double longest_average_outputs(const Scenario& s) {
    const double rate_hz = outputs_hz(s);
    const double sample_outputs = std::max(1.0, std::round(s.output.sample_interval_s * rate_hz));
    const double samples = std::floor(s.ensemble.duration_s * rate_hz / sample_outputs + 1e-9);
    return std::floor(0.5 * samples * sample_outputs);
}

bool has_deviation_at(const Scenario& s, double tau_s) {
    const double outputs = std::round(tau_s * outputs_hz(s));
    return outputs >= 1.0 && outputs <= longest_average_outputs(s);
}

std::string deviations_text(const Scenario& s) {
    return fmt::format("there are Allan deviations from {:.4g} s (a{} {}) to {:.6g} s (half of the record)",
                       1.0 / outputs_hz(s), reads_arms(s) ? "n" : "", output_name(s),
                       longest_average_outputs(s) / outputs_hz(s));
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
        return Complaint{{"output.tau_s", "ensemble.duration_s", output_key(s)},
                         fmt::format("an averaging time of {:g} s is not available: {}", tau_s, deviations_text(s))};
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
        return Complaint{
            {"specification.at_s", "specification.bias_stability_deg_h", "ensemble.duration_s"},
            fmt::format("an averaging time of {:g} s is not available: {}", wanted.at_s, deviations_text(s))};
    }
    constexpr double fewest_increments = 32.0;  // of a record that a random walk is fitted to, noise::Options
    const double fit_interval_s = std::max(s.output.sample_interval_s, least_fit_interval_s(s));
    if (wanted.arw_deg_rt_h > 0.0 && s.ensemble.duration_s < fewest_increments * fit_interval_s) {
        return Complaint{{"specification.arw_deg_rt_h", "ensemble.duration_s", "output.sample_interval_s"},
                         fmt::format("no arm can show that it meets it: "
                                     "a random walk is fitted to {:g} samples or more, and the record has {:.0f}; "
                                     "set a longer ensemble.duration_s or a shorter output.sample_interval_s{}",
                                     fewest_increments, std::floor(s.ensemble.duration_s / fit_interval_s),
                                     reads_arms(s) ? " or filter of the reader" : "")};
    }
    if (wanted.angle_error_arcsec > 0.0 && wanted.after_s > s.ensemble.duration_s) {
        return Complaint{{"specification.after_s", "specification.angle_error_arcsec", "ensemble.duration_s"},
                         fmt::format("the record ends after {:g} s; "
                                     "ask for an earlier time or set a longer ensemble.duration_s",
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
    constexpr std::int64_t fewest_rates = 3;  // of a line with an estimate of its error, as in study::scale_factor
    if (s.specification.scale_factor_error_ppm == 0.0 || s.input.sweep_points >= fewest_rates) return {};
    return Complaint{{"specification.scale_factor_error_ppm", "input.sweep_points"},
                     fmt::format("a scale factor error is that of a straight line through the rates of a sweep, "
                                 "and input.sweep_points = {}; set input.sweep_points to {} or more "
                                 "and input.sweep_stop_deg_h to the last rate, or leave the limit out (0)",
                                 s.input.sweep_points, fewest_rates)};
}

constexpr std::array all_output_rules = {
    Rule{"A sample of the output is at least one dither cycle long, or one output of the reader of a study.",
         sample_holds_an_output},
    Rule{"A run holds at least three samples.", run_holds_samples},
    Rule{"A run whose arms are read is at least thirty times as long as the reader's filter, twice its delay.",
         run_outlasts_the_reader},
    Rule{"Averaging times asked for (at most 100) are between a dither cycle, or an output of the reader of a study, "
         "and half of the record.",
         averaging_times_fit},
    Rule{"Times asked for angles (at most 100) are within the record.", angle_times_fit},
    Rule{"A specification uses averaging and other times within the record. It does not ask for less random walk "
         "than effects make by themselves, and it limits the random walk only in records of 32 samples or more.",
         specification_can_be_met},
    Rule{"A specification of the scale factor error needs a sweep of three rates or more.", scale_factor_has_a_sweep},
};

}  // namespace

std::span<const Rule> output_rules() { return all_output_rules; }

}  // namespace ringlock::scenario
