#include "app/study_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "analysis/report/table.hpp"
#include "engine/core/units.hpp"

namespace ringlock::app {

namespace {

using Json = nlohmann::ordered_json;

Json number(std::optional<double> value) { return value && std::isfinite(*value) ? Json(*value) : Json(nullptr); }

double turns_per_s(const study::Summary& summary, const store::Provenance& provenance) {
    return static_cast<double>(summary.turns) / provenance.wall_s;
}

Json json_figure(const study::Figure& figure) {
    return {{"median", number(figure.median)},
            {"lo", number(figure.lo)},
            {"hi", number(figure.hi)},
            {"median_ci", figure.median_lo ? Json{number(figure.median_lo), number(figure.median_hi)} : Json(nullptr)},
            {"resolved", figure.resolved}};
}

Json json_mean(const study::MeanFigure& figure) {
    return {{"mean", number(figure.mean)}, {"lo", number(figure.lo)}, {"hi", number(figure.hi)}};
}

Json json_arm(const study::ArmSummary& arm) {
    Json json{{"gyros", arm.gyros},
              {"arw_deg_rt_h", arm.noise_injected ? json_figure(arm.arw_deg_rt_h) : Json(nullptr)},
              {"bias_instability_deg_h",
               arm.bias_instability_deg_h ? json_figure(*arm.bias_instability_deg_h) : Json(nullptr)},
              {"rate_error_deg_h", json_mean(arm.rate_error_deg_h)}};
    json["allan"] = Json::array();
    for (const study::EnsemblePoint& point : arm.allan) {
        json["allan"].push_back({{"tau_s", point.tau_s},
                                 {"dev_deg_h", number(point.dev_deg_h)},
                                 {"lo", number(point.lo)},
                                 {"hi", number(point.hi)},
                                 {"edf", number(point.edf)}});
    }
    if (!arm.sweep.empty()) {
        json["locked_up_to_deg_h"] = number(study::locked_up_to_deg_h(arm));
        json["sweep"] = Json::array();
        for (const study::SweepPoint& point : arm.sweep) {
            json["sweep"].push_back({{"input_rate_deg_h", point.input_rate_deg_h},
                                     {"output_rate_deg_h", json_mean(point.output_rate_deg_h)},
                                     {"locked", point.locked},
                                     {"gyros", point.gyros}});
        }
    }
    return json;
}

std::string arw_cell(const study::ArmSummary& arm) {
    if (!arm.noise_injected) return "none claimed";
    const study::Figure& figure = arm.arw_deg_rt_h;
    if (figure.median) return fmt::format("{:.4g}", *figure.median);
    return figure.hi ? fmt::format("< {:.2g}", *figure.hi) : "not resolved";
}

std::string interval_cell(std::optional<double> lo, std::optional<double> hi) {
    return lo && hi ? fmt::format("{:.4g} .. {:.4g}", *lo, *hi) : "-";
}

/// Rate errors in one notation down the column.
std::string rate_cell(double rate_deg_h) {
    constexpr double half_a_digit = 5e-5;
    return fmt::format("{:.4f}", std::abs(rate_deg_h) < half_a_digit ? 0.0 : rate_deg_h);
}

report::Table arm_table(const study::Summary& summary) {
    report::Table table({{"arm", report::Align::left},
                         {"ARW [deg/sqrt(h)]", report::Align::right},
                         {"95 % of median", report::Align::right},
                         {"of theory", report::Align::right},
                         {"bias inst. [deg/h]", report::Align::right},
                         {"rate error [deg/h], 68 % of gyros", report::Align::right}});
    for (const study::ArmSummary& arm : summary.arms) {
        const study::Figure& arw = arm.arw_deg_rt_h;
        const bool shown = arm.noise_injected && arw.median;
        const auto& floor = arm.bias_instability_deg_h;
        table.add_row({arm.name, arw_cell(arm), shown ? interval_cell(arw.median_lo, arw.median_hi) : "-",
                       shown && summary.theory.arw_deg_rt_h > 0.0
                           ? fmt::format("{:.4f}", *arw.median / summary.theory.arw_deg_rt_h)
                           : "-",
                       floor ? fmt::format("{:.3g}", *floor->median) : "none claimed",
                       fmt::format("{} ({} .. {})", rate_cell(arm.rate_error_deg_h.mean),
                                   rate_cell(arm.rate_error_deg_h.lo), rate_cell(arm.rate_error_deg_h.hi))});
    }
    return table;
}

std::string sweep_text(const study::Study& study, const study::Summary& summary) {
    std::string text;
    const auto& points = summary.arms.front().sweep;
    // Every rate of a short sweep, some of a long one; all are in the file and in --json.
    constexpr std::size_t most_rows = 21;
    const std::size_t step = (points.size() + most_rows - 2) / (most_rows - 1);
    std::vector<report::Column> columns{{"input deg/h", report::Align::right}};
    for (const study::ArmSummary& arm : summary.arms) columns.push_back({arm.name, report::Align::right});
    report::Table table(columns);
    for (std::size_t i = 0; i < points.size(); i += step) {
        std::vector<std::string> row{fmt::format("{:.3f}", points[i].input_rate_deg_h)};
        for (const study::ArmSummary& arm : summary.arms) {
            row.push_back(rate_cell(arm.sweep[i].output_rate_deg_h.mean));
        }
        table.add_row(row);
    }
    text += "Mean output rate [deg/h]\n" + table.text() + "\n";
    for (const study::ArmSummary& arm : summary.arms) {
        const auto edge = study::locked_up_to_deg_h(arm);
        if (edge) {
            text += fmt::format("{}: all gyros locked (output moves by less than a fringe) up to {:.4g} deg/h\n",
                                arm.name, *edge);
        } else {
            text += fmt::format("{}: not locked at any rate of the sweep\n", arm.name);
        }
    }
    const auto& input = study.scenario.input;
    text += fmt::format("Rates are {:.4g} deg/h apart.\n", std::abs(input.sweep_stop_deg_h - input.rate_deg_h) /
                                                               static_cast<double>(input.sweep_points - 1));
    return text;
}

}  // namespace

std::string study_json(const study::Study& study, const study::Summary& summary, const store::Provenance& provenance) {
    Json json{{"scenario", provenance.scenario_file},
              {"seed", summary.seed},
              {"turns", summary.turns},
              {"wall_s", number(provenance.wall_s)},
              {"turns_per_s", number(turns_per_s(summary, provenance))}};
    json["sample_interval_s"] = study.schedule.sample_interval_s;
    json["turn_map_error_rad"] = number(study.turn_map_error_rad);
    json["arms"] = Json::object();
    for (const study::ArmSummary& arm : summary.arms) json["arms"][arm.name] = json_arm(arm);
    json["theory"] = {{"arw_deg_rt_h", number(summary.theory.arw_deg_rt_h)},
                      {"dead_band_deg_h", number(summary.theory.dead_band_deg_h)}};
    return json.dump(2) + "\n";
}

std::string study_text(const study::Study& study, const study::Summary& summary, const store::Provenance& provenance) {
    const double duration_s = study.schedule.sample_interval_s * static_cast<double>(study.schedule.samples - 1);
    std::string text = fmt::format("{}: {} gyros, {:.6g} s each, {} turns in {:.1f} s ({:.3g} a second), seed {}\n\n",
                                   provenance.scenario_file, study.gyros.size(), duration_s, summary.turns,
                                   provenance.wall_s, turns_per_s(summary, provenance), summary.seed);
    text += arm_table(summary).text();
    text += fmt::format("{}\n",
                        fmt::format("theory: angle random walk with turns fully randomised {:.5g} deg/sqrt(h), dead "
                                    "band +-{:.4g} deg/h (first order)",
                                    summary.theory.arw_deg_rt_h, summary.theory.dead_band_deg_h));
    const bool deterministic =
        std::any_of(summary.arms.begin(), summary.arms.end(), [](const auto& arm) { return !arm.noise_injected; });
    if (deterministic) {
        text +=
            "No random walk is claimed without injected noise: the lock-in error is then a dead band and a staircase,\n"
            "not noise.\n";
    }
    if (!summary.arms.front().sweep.empty()) text += "\n" + sweep_text(study, summary);
    return text;
}

report::Figure study_figure(const study::Study& study, const study::Summary& summary) {
    report::Figure figure;
    using Style = report::Curve::Style;
    if (!summary.arms.front().sweep.empty()) {
        figure.title = "Output rate against input rate";
        figure.x_label = "input rate [deg/h]";
        figure.y_label = "mean output rate [deg/h]";
        figure.log_x = figure.log_y = false;
        for (const study::ArmSummary& arm : summary.arms) {
            report::Curve curve{arm.name, {}, {}, {}, {}, Style::line};
            for (const study::SweepPoint& point : arm.sweep) {
                curve.x.push_back(point.input_rate_deg_h);
                curve.y.push_back(point.output_rate_deg_h.mean);
            }
            figure.curves.push_back(std::move(curve));
        }
        return figure;
    }
    figure.title = fmt::format("Overlapping Allan deviation, {} gyros", study.gyros.size());
    figure.x_label = "averaging time tau [s]";
    figure.y_label = "Allan deviation [deg/h]";
    figure.log_x = figure.log_y = true;
    for (const study::ArmSummary& arm : summary.arms) {
        report::Curve curve{arm.name, {}, {}, {}, {}, Style::points};
        for (const study::EnsemblePoint& point : arm.allan) {
            curve.x.push_back(point.tau_s);
            curve.y.push_back(point.dev_deg_h);
            curve.lo.push_back(point.lo);
            curve.hi.push_back(point.hi);
        }
        figure.curves.push_back(std::move(curve));
    }
    const double arw_deg_h_rt_s = summary.theory.arw_deg_rt_h / units::deg_rt_h_per_arcsec_rt_s;
    report::Curve theory{"theory: turns fully randomised", {}, {}, {}, {}, Style::dashed};
    for (const study::EnsemblePoint& point : summary.arms.front().allan) {
        theory.x.push_back(point.tau_s);
        theory.y.push_back(arw_deg_h_rt_s / std::sqrt(point.tau_s));
    }
    figure.curves.push_back(std::move(theory));
    return figure;
}

}  // namespace ringlock::app
