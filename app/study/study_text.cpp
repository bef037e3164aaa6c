#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "analysis/report/passage.hpp"
#include "analysis/report/table.hpp"
#include "app/study/study_output.hpp"
#include "engine/core/printable.hpp"
#include "engine/ensemble/schedule.hpp"

namespace ringlock::app {

namespace {

std::string arw_cell(const study::ArmSummary& arm) {
    if (!study::has_arw(arm)) return "none";
    const study::Figure& figure = arm.arw_deg_rt_h;
    if (figure.median) return fmt::format("{:.4g}", *figure.median);
    return figure.hi ? fmt::format("< {:.2g}", *figure.hi) : "not resolved";
}

std::string interval_cell(std::optional<double> lo, std::optional<double> hi) {
    return lo && hi ? fmt::format("{:.3g} .. {:.3g}", *lo, *hi) : "-";
}

std::string ratio_cell(double ratio) {
    constexpr double least_in_decimals = 1e-3;
    return ratio < least_in_decimals ? fmt::format("{:.2g}", ratio) : fmt::format("{:.4f}", ratio);
}

/// Narrow enough for two intervals next to the longest name of an arm in 100 columns.
std::string narrow_interval(std::optional<double> lo, std::optional<double> hi) {
    return lo && hi ? fmt::format("{:.3g}..{:.3g}", *lo, *hi) : "-";
}

using report::Passage;

/// Random walks, and below them biases: both fit 100 columns.
void add_arm_tables(const study::Summary& summary, std::vector<Passage>& out) {
    report::Table walks({{"arm", report::Align::left},
                         {"ARW", report::Align::right},
                         {"95 % of median", report::Align::right},
                         {"68 % of gyros", report::Align::right},
                         {"theory's", report::Align::right}});
    report::Table rates({{"arm", report::Align::left},
                         {"rate error", report::Align::right},
                         {"68 % of gyros", report::Align::right},
                         {"bias instability", report::Align::right}});
    for (const study::ArmSummary& arm : summary.arms) {
        const study::Figure& arw = arm.arw_deg_rt_h;
        const double theory = arm.arw_theory.total_deg_rt_h;
        walks.add_row({arm.name, arw_cell(arm), arw.median ? narrow_interval(arw.median_lo, arw.median_hi) : "-",
                       arw.median ? narrow_interval(arw.lo, arw.hi) : "-",
                       arw.median && theory > 0.0 ? ratio_cell(*arw.median / theory) : "-"});
        const auto& floor = arm.bias_instability_deg_h;
        rates.add_row({arm.name, rate_text(arm.rate_error_deg_h.mean),
                       fmt::format("{} .. {}", rate_text(arm.rate_error_deg_h.lo), rate_text(arm.rate_error_deg_h.hi)),
                       floor ? fmt::format("{:.3g}", *floor->median) : "none"});
    }
    out.push_back({.heading = "Angle random walk [deg/sqrt(h)], and over that of theory", .table = walks});
    out.push_back({.heading = "Mean rate less the input rate, and bias instability [deg/h]", .table = rates});
}

/// Scatter of averages from gyro to gyro, and of turn-ons.
void add_scatter(const study::Summary& summary, std::vector<Passage>& out) {
    if (summary.arms.front().scatter.empty()) return;
    std::vector<report::Column> columns{{"arm", report::Align::left}};
    for (const study::AverageScatter& average : summary.arms.front().scatter) {
        columns.push_back({fmt::format("{:.4g} s", average.after_s), report::Align::right});
    }
    const bool turn_ons = summary.arms.front().turn_on_repeatability.has_value();
    if (turn_ons) columns.push_back({"turn-on to turn-on", report::Align::right});
    report::Table table(columns);
    for (const study::ArmSummary& arm : summary.arms) {
        std::vector<std::string> row{arm.name};
        for (const study::AverageScatter& average : arm.scatter) {
            row.push_back(fmt::format("{:.3g}", average.scatter.sd_deg_h));
        }
        if (turn_ons) row.push_back(fmt::format("{:.3g}", arm.turn_on_repeatability->sd_deg_h));
        table.add_row(row);
    }
    out.push_back({.heading = "Scatter over the gyros of rates averaged from the start on [deg/h]", .table = table});
}

/// The terms of the theory, and why arms have no random walk.
std::string walk_notes(const study::Summary& summary) {
    std::string text =
        fmt::format("theory: random walk of turns at random phases {:.5g} deg/sqrt(h)", summary.theory.arw_deg_rt_h);
    for (const auto& [effect, deg_rt_h] : summary.arms.front().arw_theory.effects_deg_rt_h) {
        text += fmt::format(", {} {:.5g}", effect, deg_rt_h);
    }
    text += fmt::format(";\ndead band +-{:.4g} deg/h (first order)\n", summary.theory.dead_band_deg_h);
    for (const study::ArmSummary& arm : summary.arms) {
        if (!arm.arw_reason.empty()) text += fmt::format("{}: no random walk; {}\n", arm.name, arm.arw_reason);
    }
    return text;
}

std::string percent_cell(const lot::Share& share) {
    if (!share.value || !share.interval) return "-";
    return fmt::format("{:.1f} ({:.1f} .. {:.1f})", 100.0 * *share.value, 100.0 * share.interval->lo,
                       100.0 * share.interval->hi);
}

/// Gyros that pass the specification, limit by limit.
void add_yields(const study::Summary& summary, std::vector<Passage>& out) {
    if (!summary.arms.front().yield) return;
    report::Table table(
        {{"arm", report::Align::left}, {"limit", report::Align::left}, {"pass [%], 95 %", report::Align::right}});
    for (const study::ArmSummary& arm : summary.arms) {
        table.add_row({arm.name, "all", percent_cell(arm.yield->share)});
        for (const study::LimitYield& limit : arm.yield->limits) {
            const char* most = limit.name == arm.yield->fails_most ? " (worst)" : "";
            table.add_row({"", fmt::format("{} {:g}{}", limit.name, limit.most, most), percent_cell(limit.share)});
        }
    }
    out.push_back({.heading = "Specification", .table = table});
}

void add_deviation(report::Table& table, const std::string& arm, const study::EnsemblePoint& p) {
    table.add_row({arm, fmt::format("{:.6g}", p.tau_s), fmt::format("{:.4g}", p.dev_deg_h), interval_cell(p.lo, p.hi)});
}

report::Table deviation_table() {
    return report::Table({{"arm", report::Align::left},
                          {"tau [s]", report::Align::right},
                          {"deviation", report::Align::right},
                          {"interval", report::Align::right}});
}

/// Deviations at the averaging times that the scenario requests, one row an arm.
void add_scenario_times(const study::Study& study, const study::Summary& summary, std::vector<Passage>& out) {
    if (study.scenario.output.tau_s.empty()) return;
    std::vector<std::int64_t> asked;
    for (const double tau_s : study.scenario.output.tau_s) asked.push_back(ensemble::outputs_in(study.schedule, tau_s));
    std::sort(asked.begin(), asked.end());
    asked.erase(std::unique(asked.begin(), asked.end()), asked.end());
    report::Table table = deviation_table();
    for (const study::ArmSummary& arm : summary.arms) {
        for (std::size_t i = 0; i < arm.allan.size(); ++i) {
            if (!std::binary_search(asked.begin(), asked.end(), study.factors[i])) continue;
            add_deviation(table, arm.name, arm.allan[i]);
        }
    }
    out.push_back({.heading = "Allan deviation [deg/h], 68.27 % intervals", .table = table});
}

std::string signed_cell(const study::SignedFigure& figure) {
    const std::string mean = figure.mean ? fmt::format("{:.3g}", *figure.mean) : "none seen";
    return fmt::format("{} ({:.2g} .. {:.2g})", mean, figure.lo, figure.hi);
}

std::string size_cell(const study::SizeFigure& figure) {
    if (!figure.value) return figure.hi > 0.0 ? fmt::format("< {:.2g}", figure.hi) : "none";
    return fmt::format("{:.3g} ({:.2g} .. {:.2g})", *figure.value, figure.lo, figure.hi);
}

/// The straight line through the rates of a sweep, arm by arm.
void add_scale_factor(const study::Study& study, const study::Summary& summary, std::vector<Passage>& out) {
    if (!summary.arms.front().scale_factor) return;
    report::Table slopes({{"arm", report::Align::left},
                          {"scale factor error [ppm]", report::Align::right},
                          {"repeatability [ppm]", report::Align::right},
                          {"of which noise", report::Align::right},
                          {"beyond noise [ppm]", report::Align::right},
                          {"bias [deg/h]", report::Align::right}});
    report::Table deviations({{"arm", report::Align::left},
                              {"largest deviation [deg/h]", report::Align::right},
                              {"at", report::Align::right},
                              {"nonlinearity [ppm of full scale]", report::Align::right},
                              {"of one gyro [deg/h]", report::Align::right},
                              {"scatter [deg/h]", report::Align::right}});
    for (const study::ArmSummary& arm : summary.arms) {
        const study::ScaleFactor& line = *arm.scale_factor;
        slopes.add_row({arm.name, signed_cell(line.scale_factor_ppm), size_cell(line.repeatability_ppm),
                        fmt::format("{:.3g}", line.noise_ppm), size_cell(line.beyond_noise_ppm),
                        signed_cell(line.bias_deg_h)});
        deviations.add_row(
            {arm.name, size_cell(line.largest_deviation_deg_h),
             line.largest_deviation_deg_h.value ? fmt::format("{:.4g}", line.largest_deviation_at_deg_h) : "-",
             size_cell(line.nonlinearity_ppm),
             fmt::format("{:.3g} ({:.2g} .. {:.2g})", line.gyro_deviation_deg_h, line.gyro_deviation_lo_deg_h,
                         line.gyro_deviation_hi_deg_h),
             fmt::format("{:.3g}", line.scatter_deg_h)});
    }
    out.push_back({.heading = fmt::format(
                       "Straight lines through the rates, {} gyros at each, full scale {:.4g} deg/h; in brackets 95 % "
                       "intervals,\nof one gyro's largest deviation 68 % of the gyros (docs/scale-factor.md)",
                       study.scenario.ensemble.gyros, summary.arms.front().scale_factor->full_scale_deg_h),
                   .table = slopes});
    out.push_back({.table = deviations});
}

std::string optional_cell(const std::optional<double>& value, const char* absent = "-") {
    return value && std::isfinite(*value) ? fmt::format("{:.3g}", *value) : std::string(absent);
}

/// Effect of the injected noise, predicted and measured.
void add_noise(const study::ArmSummary& arm, std::vector<Passage>& out) {
    if (!arm.noise_effectiveness) return;
    const dither::NoiseEffectiveness& predicted = arm.noise_effectiveness->predicted;
    const auto& seen = arm.noise_effectiveness->measured;
    const bool steady = seen.bias_deg_h.has_value();
    report::Table table(
        {{steady ? fmt::format("injected noise at {:g} deg/h", predicted.input_rate_deg_h) : "injected noise",
          report::Align::left},
         {"predicted", report::Align::right},
         {"measured", report::Align::right}});
    table.add_row({"rms change of the amplitude per cycle [rad]", fmt::format("{:.3g}", predicted.change_per_cycle_rad),
                   fmt::format("{:.3g}", seen.change_per_cycle_rad)});
    table.add_row({"the same in per cent of the dither",
                   fmt::format("{:.3g}", arm.noise_effectiveness->change_per_cycle_percent), ""});
    if (steady) {
        table.add_row({"ARW over that of randomised turns", optional_cell(predicted.arw_over_theory),
                       optional_cell(seen.arw_over_theory)});
        table.add_row({"bias [deg/h]", optional_cell(predicted.bias_deg_h),
                       fmt::format("{:.3g} +- {:.2g}", *seen.bias_deg_h, seen.bias_error_deg_h)});
    }
    for (std::size_t i = 0; i < predicted.angle_spread.size() && i < seen.angle_spread.size(); ++i) {
        table.add_row({fmt::format("angle after {:g} s, sd over the gyros [arcsec]", predicted.angle_spread[i].after_s),
                       fmt::format("{:.3g}", predicted.angle_spread[i].arcsec),
                       optional_cell(seen.angle_spread[i].arcsec)});
    }
    std::string notes = predicted.reason.empty() ? "" : fmt::format("({})\n", printable(predicted.reason));
    const std::string& why = arm.noise_effectiveness->not_randomised;
    if (!why.empty()) notes += fmt::format("warning: the injected noise does not randomise the turns: {}\n", why);
    out.push_back({.table = table, .notes = notes});
}

/// Random walk of noise_injected over that of each other arm with injected noise: the reduction by the compensators.
void add_reduction(const study::Summary& summary, std::vector<Passage>& out) {
    report::Table table({{"random walk of noise_injected over that of", report::Align::left},
                         {"ratio", report::Align::right},
                         {"95 %", report::Align::right}});
    bool any = false;
    for (const study::ArmSummary& arm : summary.arms) {
        const auto& reduction = arm.arw_reduction;
        if (!reduction) continue;
        any = true;
        const bool known = reduction->ratio && reduction->hi;
        table.add_row({arm.name,
                       known ? fmt::format("{:.4g}", *reduction->ratio) : fmt::format("> {:.2g}", reduction->lo),
                       known ? fmt::format("{:.4g} .. {:.4g}", reduction->lo, *reduction->hi) : "-"});
    }
    if (any) out.push_back({.table = table});
}

/// Random walks gyro by gyro, every arm over every other.
void add_pairs(const study::Summary& summary, std::vector<Passage>& out) {
    std::vector<std::string> names;
    for (const study::ArmSummary& arm : summary.arms) {
        if (arm.arw_deg_rt_h.median) names.push_back(arm.name);
    }
    if (names.size() < 3) return;  // one ratio follows from the medians
    std::vector<report::Column> columns{{"random walk, gyro by gyro: row over column", report::Align::left}};
    for (std::size_t i = 0; i < names.size(); ++i)
        columns.push_back({fmt::format("({})", i + 1), report::Align::right});
    report::Table table(columns);
    bool alike = false;
    for (std::size_t i = 0; i < names.size(); ++i) {
        std::vector<std::string> row{fmt::format("({}) {}", i + 1, names[i])};
        for (std::size_t j = 0; j < names.size(); ++j) {
            const auto pair = std::find_if(summary.pairs.begin(), summary.pairs.end(), [&](const study::ArmPair& p) {
                return (p.first == names[i] && p.second == names[j]) || (p.first == names[j] && p.second == names[i]);
            });
            if (pair == summary.pairs.end() || !pair->arw_deg_rt_h.ratio.value) {
                row.emplace_back("");
                continue;
            }
            const lot::PairedFigure& ratio = pair->arw_deg_rt_h.ratio;
            const double value = pair->first == names[i] ? *ratio.value : 1.0 / *ratio.value;
            row.push_back(fmt::format("{:.3g}{}", value, ratio.distinguishable ? "" : " ="));
            alike = alike || !ratio.distinguishable;
        }
        table.add_row(row);
    }
    out.push_back({.table = table, .notes = alike ? "= : no significant difference (95 %)\n" : ""});
}

/// Where the arm stands on the staircase.
void add_steps(const study::ArmSummary& arm, std::vector<Passage>& out) {
    if (arm.steps.empty()) return;
    report::Table table({{"step n", report::Align::right},
                         {"output deg/h", report::Align::right},
                         {"from input deg/h", report::Align::right},
                         {"to", report::Align::right}});
    for (const study::Step& step : arm.steps) {
        table.add_row({fmt::format("{}", step.order), rate_text(step.output_rate_deg_h),
                       fmt::format("{:.3f}", step.first_deg_h), fmt::format("{:.3f}", step.last_deg_h)});
    }
    out.push_back({.heading = fmt::format("{}: all gyros locked to n fringes a dither cycle (closed form)", arm.name),
                   .table = table});
}

void add_sweep(const study::Study& study, const study::Summary& summary, std::vector<Passage>& out) {
    const auto& points = summary.arms.front().sweep;
    // Every rate of a short sweep, some of a long one; all are in the file and in --json.
    constexpr std::size_t most_rows = 21;
    const std::size_t step = (points.size() + most_rows - 2) / (most_rows - 1);
    std::vector<report::Column> columns{{"input deg/h", report::Align::right}};
    for (const study::ArmSummary& arm : summary.arms) {
        columns.push_back({arm.name, report::Align::right});
        if (study::has_closed_form(arm)) columns.push_back({"closed form", report::Align::right});
    }
    report::Table table(columns);
    for (std::size_t i = 0; i < points.size(); i += step) {
        std::vector<std::string> row{fmt::format("{:.3f}", points[i].input_rate_deg_h)};
        for (const study::ArmSummary& arm : summary.arms) {
            const study::SweepPoint& point = arm.sweep[i];
            row.push_back(rate_text(point.output_rate_deg_h.mean));
            if (!study::has_closed_form(arm)) continue;
            row.push_back(point.closed_form_rate_deg_h ? rate_text(*point.closed_form_rate_deg_h) : "-");
        }
        table.add_row(row);
    }
    out.push_back({.heading = "Mean output rate [deg/h]", .table = table});
    std::string text;
    for (const study::ArmSummary& arm : summary.arms) {
        const auto edge = study::locked_up_to_deg_h(arm);
        if (edge) {
            text += fmt::format("{}: all gyros locked (output moves by less than a fringe) up to {:.4g} deg/h\n",
                                arm.name, *edge);
        } else {
            text += fmt::format("{}: not locked at any rate of the sweep\n", arm.name);
        }
    }
    const std::size_t before_steps = out.size();
    for (const study::ArmSummary& arm : summary.arms) add_steps(arm, out);
    const auto& input = study.scenario.input;
    const std::string apart =
        fmt::format("Rates are {:.4g} deg/h apart.\n",
                    std::abs(input.sweep_stop_deg_h - input.rate_deg_h) / static_cast<double>(input.sweep_points - 1));
    if (out.size() > before_steps) {
        out.insert(out.begin() + static_cast<std::ptrdiff_t>(before_steps), {.notes = text});
        out.push_back({.notes = apart});
    } else {
        out.push_back({.notes = text + apart});
    }
    add_scale_factor(study, summary, out);
}

}  // namespace

std::string rate_text(double rate_deg_h) {
    constexpr double half_a_digit = 5e-5;
    return fmt::format("{:.4f}", std::abs(rate_deg_h) < half_a_digit ? 0.0 : rate_deg_h);
}

std::string family_text(const study::Summary& summary) {
    std::string text;
    const auto& first = summary.arms.front().family;
    for (std::size_t k = 0; k < first.size(); ++k) {
        const allan::Traits& t = allan::traits(first[k].estimator);
        text += fmt::format("\n{} [{}]{}\n{:>12}", t.name, t.time ? "arcsec" : "deg/h",
                            t.has_interval ? ", 68.27 % intervals" : "", "tau [s]");
        for (const study::ArmSummary& arm : summary.arms) text += fmt::format("  {:>36}", arm.name);
        text += "\n";
        for (std::size_t i = 0; i < first[k].points.size(); ++i) {
            text += fmt::format("{:>12.6g}", first[k].points[i].tau_s);
            for (const study::ArmSummary& arm : summary.arms) {
                const study::EnsemblePoint& p = arm.family[k].points[i];
                const std::string interval =
                    std::isfinite(p.lo) ? fmt::format(" ({:.3e} .. {:.3e})", p.lo, p.hi) : std::string();
                text += fmt::format("  {:>36}", fmt::format("{:.4e}{}", p.dev_deg_h, interval));
            }
            text += "\n";
        }
    }
    return text;
}

std::vector<report::Passage> study_passages(const study::Study& study, const study::Summary& summary) {
    std::vector<Passage> all;
    add_arm_tables(summary, all);
    add_scatter(summary, all);
    all.push_back({.notes = walk_notes(summary)});
    add_reduction(summary, all);
    add_pairs(summary, all);
    add_scenario_times(study, summary, all);
    add_yields(summary, all);
    for (const study::ArmSummary& arm : summary.arms) add_noise(arm, all);
    if (!summary.arms.front().sweep.empty()) add_sweep(study, summary, all);
    return all;
}

std::string study_text(const study::Study& study, const study::Summary& summary) {
    return report::text_of(study_passages(study, summary)) + family_text(summary);
}

std::string asked_text(const study::Study& study, const study::Summary& summary, std::span<const AveragingTime> asked) {
    report::Table table = deviation_table();
    for (const study::ArmSummary& arm : summary.arms) {
        for (const study::EnsemblePoint& point : arm.asked) add_deviation(table, arm.name, point);
    }
    const double interval_s = study.schedule.sample_interval_s;
    std::string text = fmt::format(
        "\nAllan deviation [deg/h] at the averaging times asked for, from stored samples of {:.6g} s;\n"
        "68.27 % intervals\n{}",
        interval_s, table.text());
    for (const AveragingTime& time : asked) {
        if (!time.time_s) continue;
        // Both with the digits of the table: times that are equal in these digits need no line.
        const std::string wanted = fmt::format("{:.6g}", *time.time_s);
        const std::string found = fmt::format("{:.6g}", interval_s * static_cast<double>(time.samples));
        if (wanted == found) continue;
        text += fmt::format("asked {} s, nearest whole number of samples: {} s\n", wanted, found);
    }
    return text;
}

}  // namespace ringlock::app
