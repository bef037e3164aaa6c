#include "analysis/report/closure_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/report/rate_series.hpp"

namespace ringlock::report {

namespace {

using closure::Closure;
using closure::Estimate;
using closure::Predictive;
using closure::PredictiveStatistic;
using closure::Step;

const PredictiveStatistic* find(const Predictive& predictive, std::string_view name) {
    for (const PredictiveStatistic& statistic : predictive.statistics) {
        if (statistic.name == name && !statistic.x.empty()) return &statistic;
    }
    return nullptr;
}

/// Measured values over the lowest and the highest of the simulations, and the mean of those of the base model.
void add_band(const PredictiveStatistic& statistic, const std::string& kind, int simulations, Figure& figure) {
    figure.curves.push_back({.label = "measured" + kind, .x = statistic.x, .y = statistic.measured});
    figure.curves.push_back({.label = fmt::format("{} simulations, lowest to highest{}", simulations, kind),
                             .x = statistic.x,
                             .y = statistic.lowest,
                             .lo = statistic.lowest,
                             .hi = statistic.highest,
                             .style = Curve::Style::band});
    if (!statistic.measured_whole.empty()) {
        figure.curves.push_back({.label = "measured, disturbed stretches included",
                                 .x = statistic.x,
                                 .y = statistic.measured_whole,
                                 .style = Curve::Style::line});
    }
    if (!statistic.base.empty()) {
        figure.curves.push_back({.label = "base model alone, mean" + kind,
                                 .x = statistic.x,
                                 .y = statistic.base,
                                 .style = Curve::Style::dashed});
    }
}

/// Value of the first parameter of the step that has the role; NaN if there is no such parameter.
double value_of(const Step& step, effects::Role role) {
    const effects::Parameter* parameter = effects::first_of(*step.effect, role);
    for (const Estimate& estimate : step.parameters) {
        if (parameter != nullptr && estimate.name == parameter->name) return estimate.value;
    }
    return std::numeric_limits<double>::quiet_NaN();
}

Curve vertical(std::string label, double x, double low, double high) {
    return {.label = std::move(label), .x = {x, x}, .y = {low, high}, .style = Curve::Style::line};
}

/// Points whose averaging time overlaps one of the spans.
Curve points_within(const closure::RateSeries& rates, const std::vector<closure::TimeSpan>& spans) {
    Curve curve;
    for (std::size_t i = 0; i < rates.time_s.size(); ++i) {
        const bool is = std::any_of(spans.begin(), spans.end(), [&](const closure::TimeSpan& span) {
            return rates.time_s[i] + 0.5 * rates.interval_s > span.from_s &&
                   rates.time_s[i] - 0.5 * rates.interval_s < span.to_s;
        });
        if (!is) continue;
        curve.x.push_back(rates.time_s[i]);
        curve.y.push_back(rates.rate_deg_h[i]);
    }
    return curve;
}

Picture over_time(const std::string& source, const record::Record& record, const Closure& closure) {
    const closure::RateSeries rates = averaged(closure::rates_of(record), closure::options.report.points_over_time);
    Picture picture{
        .file = "record.svg",
        .caption =
            fmt::format("The record over time as mean rates over {:.3g} s, and the deterministic part of the model. "
                        "Vertical lines mark the times at which effects begin.",
                        rates.interval_s),
        .figure = {
            .title = fmt::format("Rate of {} over time", source), .x_label = "time [s]", .y_label = "rate [deg/h]"}};
    if (rates.rate_deg_h.empty()) return picture;
    std::vector<Curve>& curves = picture.figure.curves;
    curves.push_back({.label = "measured", .x = rates.time_s, .y = rates.rate_deg_h, .style = Curve::Style::line});
    const auto [low, high] = std::minmax_element(rates.rate_deg_h.begin(), rates.rate_deg_h.end());
    for (const Step& step : closure.steps) {
        const double time_s = value_of(step, effects::Role::time);
        if (!std::isfinite(time_s)) continue;
        curves.push_back(vertical(fmt::format("{} at {:.6g} s", step.effect->name(), time_s), time_s, *low, *high));
    }
    for (const auto& [label, spans] : {std::pair{"disturbed, left out of the fit", &closure.disturbed},
                                       std::pair{"missing, filled in, left out of the fit", &closure.gaps}}) {
        Curve within = points_within(rates, *spans);
        within.label = label;
        if (!within.x.empty()) curves.push_back(std::move(within));
    }
    curves.push_back({.label = "model, deterministic part",
                      .x = rates.time_s,
                      .y = determined_rates(record, closure, rates),
                      .style = Curve::Style::dashed});
    return picture;
}

/// The spectrum about each line that was found.
void add_lines(const std::string& source, const record::Record& record, const Closure& closure,
               std::vector<Picture>& all) {
    const closure::RateSeries rates = closure::rates_of(record);
    std::size_t drawn = 0;
    for (const Step& step : closure.steps) {
        const double hz = value_of(step, effects::Role::frequency);
        if (!std::isfinite(hz) || drawn == closure::options.report.most_lines_drawn) continue;
        const double shown_hz = std::abs(std::remainder(hz, 1.0 / rates.interval_s));
        const closure::NearLine near = spectrum_near(rates, shown_hz);
        if (near.hz.empty()) continue;
        ++drawn;
        std::string folded;
        if (std::abs(shown_hz - hz) > near.resolution_hz) {
            folded = fmt::format(" The record shows a line of {:.6g} Hz there.", hz);
        }
        Picture picture{.file = fmt::format("line-{}.svg", drawn),
                        .caption = fmt::format("Spectrum of the record about the line of `{}` at {:.6g} Hz; "
                                               "the resolution of the record is {:.2g} Hz.{}",
                                               step.effect->name(), shown_hz, near.resolution_hz, folded),
                        .figure = {.title = fmt::format("Spectrum of {} about {:.6g} Hz", source, shown_hz),
                                   .x_label = "frequency [Hz]",
                                   .y_label = "amplitude [deg/h]"}};
        picture.figure.curves.push_back(
            {.label = "measured", .x = near.hz, .y = near.amplitude_deg_h, .style = Curve::Style::line});
        const double high = *std::max_element(near.amplitude_deg_h.begin(), near.amplitude_deg_h.end());
        picture.figure.curves.push_back(
            vertical(fmt::format("{} as fitted", step.effect->name()), shown_hz, 0.0, high));
        all.push_back(std::move(picture));
    }
}

}  // namespace

std::vector<Picture> predictive_pictures(const std::string& source, const Predictive& predictive) {
    std::vector<Picture> all;
    const auto logarithmic = [&](const char* name, const char* file, const char* title, const char* y_label) {
        const PredictiveStatistic* statistic = find(predictive, name);
        if (statistic == nullptr) return;
        Picture picture;
        picture.file = file;
        picture.caption = fmt::format(
            "{}: circles are the record, the band is the range of simulations of the closed model. "
            "Circles outside of the band show structure that the model lacks.{}{}",
            title, statistic->base.empty() ? "" : " The dashed line is the base model without the effects.",
            statistic->measured_whole.empty()
                ? ""
                : " Circles and simulations leave out disturbed stretches; the thin line includes them.");
        picture.figure = {.title = fmt::format("{} of {}", title, source),
                          .x_label = fmt::format("{} [{}]", statistic->x_name, statistic->x_unit),
                          .y_label = y_label,
                          .log_x = true,
                          .log_y = true};
        add_band(*statistic, "", predictive.simulations, picture.figure);
        all.push_back(std::move(picture));
    };
    logarithmic("allan_deviation", "allan.svg", "Allan deviation", "Allan deviation [deg/h]");
    logarithmic("spectrum", "spectrum.svg", "Spectrum of the rate", "root of the power density [deg/h/√Hz]");
    Picture folded{
        .file = "folded.svg",
        .caption =
            "Change of the angle across a turn, by the phase at which it turns: "
            "the kick of the lock-in. Markers are the record, bands the range of simulations of the closed model.",
        .figure = {.title = fmt::format("Change of {} across its turns, by their phase", source),
                   .x_label = "phase at the turn [rad]",
                   .y_label = "gain less its mean [mrad of phase]"}};
    for (const auto& [name, kind] : {std::pair{"folded_minima", ", minima"}, std::pair{"folded_maxima", ", maxima"}}) {
        const PredictiveStatistic* statistic = find(predictive, name);
        if (statistic == nullptr) continue;
        PredictiveStatistic in_mrad = *statistic;
        for (auto* values : {&in_mrad.measured, &in_mrad.lowest, &in_mrad.highest, &in_mrad.base}) {
            for (double& value : *values) value *= 1e3;
        }
        add_band(in_mrad, kind, predictive.simulations, folded.figure);
    }
    if (!folded.figure.curves.empty()) all.push_back(std::move(folded));
    return all;
}

Picture step_picture(const std::string& source, const Closure& closure) {
    Picture steps{.file = "steps.svg",
                  .caption =
                      "Held-out one-step error of the base model and after each effect; the dashed line is the error "
                      "that the noise of the last model alone gives. An effect that does not change the next reading, "
                      "such as a rounding of the values, does not change the error.",
                  .figure = {.title = fmt::format("Held-out error of {}, step by step", source),
                             .x_label = "effects in the model",
                             .y_label = fmt::format("rms one-step error [{}]", closure.unit),
                             .log_y = true,
                             .whole_x = true}};
    Curve error{.label = "held-out error", .x = {0.0}, .y = {closure.heldout_before}, .style = Curve::Style::line};
    steps.figure.curves.push_back({.label = "0: base model", .x = {0.0}, .y = {closure.heldout_before}});
    for (std::size_t k = 0; k < closure.steps.size(); ++k) {
        const auto number = static_cast<double>(k + 1);
        const double after = closure.steps[k].heldout_error_after;
        error.x.push_back(number);
        error.y.push_back(after);
        steps.figure.curves.push_back(
            {.label = fmt::format("{}: {}", k + 1, closure.steps[k].effect->name()), .x = {number}, .y = {after}});
    }
    const double last = std::max<double>(1.0, static_cast<double>(closure.steps.size()));
    if (error.x.size() > 1) steps.figure.curves.push_back(std::move(error));
    steps.figure.curves.push_back({.label = "noise floor",
                                   .x = {0.0, last},
                                   .y = {closure.noise_floor, closure.noise_floor},
                                   .style = Curve::Style::dashed});
    return steps;
}

std::vector<Picture> closure_pictures(const std::string& source, const record::Record& record, const Closure& closure,
                                      const Predictive& predictive) {
    std::vector<Picture> all{over_time(source, record, closure)};
    for (Picture& picture : predictive_pictures(source, predictive)) all.push_back(std::move(picture));
    add_lines(source, record, closure, all);
    all.push_back(step_picture(source, closure));
    return all;
}

}  // namespace ringlock::report
