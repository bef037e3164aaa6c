#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/study/study_output.hpp"
#include "engine/core/units.hpp"

namespace ringlock::app {

namespace {

/// Whether a sweep is so wide that on the diagonal of output against input the errors would not be seen.
bool diagonal_hides_errors(const study::Study& study, const study::Summary& summary) {
    constexpr double visible = 0.1;
    double largest_deg_h = 0.0;
    for (const study::ArmSummary& arm : summary.arms) {
        for (const study::SweepPoint& point : arm.sweep) {
            const double error_deg_h = point.output_rate_deg_h.mean - point.input_rate_deg_h;
            largest_deg_h = std::max(largest_deg_h, std::abs(error_deg_h));
        }
    }
    const auto& input = study.scenario.input;
    return largest_deg_h < visible * std::abs(input.sweep_stop_deg_h - input.rate_deg_h);
}

/// Leaves of a curve those points that lie apart by more than a marker.
report::Curve thinned(report::Curve curve) {
    if (curve.x.empty()) return curve;
    const auto span = [](const std::vector<double>& v) {
        const auto [lowest, highest] = std::minmax_element(v.begin(), v.end());
        return std::max(*highest - *lowest, 1e-300);
    };
    constexpr double apart = 0.025;  // of the axes
    const double x_span = span(curve.x);
    const double y_span = span(curve.y);
    std::size_t kept = 1;
    for (std::size_t i = 1; i < curve.x.size(); ++i) {
        const double x = (curve.x[i] - curve.x[kept - 1]) / x_span;
        const double y = (curve.y[i] - curve.y[kept - 1]) / y_span;
        if (std::hypot(x, y) < apart) continue;
        curve.x[kept] = curve.x[i];
        curve.y[kept++] = curve.y[i];
    }
    curve.x.resize(kept);
    curve.y.resize(kept);
    return curve;
}

report::Figure sweep_figure(const study::Study& study, const study::Summary& summary) {
    using Style = report::Curve::Style;
    report::Figure figure;
    const bool errors = diagonal_hides_errors(study, summary);
    figure.title = errors ? "Rate error against input rate" : "Output rate against input rate";
    figure.x_label = "input rate [deg/h]";
    figure.y_label = errors ? "mean output rate less input rate [deg/h]" : "mean output rate [deg/h]";
    for (const study::ArmSummary& arm : summary.arms) {
        const bool closed = study::has_closed_form(arm);
        report::Curve simulated{arm.name, {}, {}, {}, {}, closed ? Style::points : Style::line};
        report::Curve exact{arm.name + ", closed form", {}, {}, {}, {}, Style::dashed};
        for (const study::SweepPoint& point : arm.sweep) {
            const double from = errors ? point.input_rate_deg_h : 0.0;
            simulated.x.push_back(point.input_rate_deg_h);
            simulated.y.push_back(point.output_rate_deg_h.mean - from);
            exact.x.push_back(point.input_rate_deg_h);
            exact.y.push_back(point.closed_form_rate_deg_h.value_or(std::nan("")) - from);
        }
        figure.curves.push_back(closed ? thinned(std::move(simulated)) : std::move(simulated));
        if (closed) figure.curves.push_back(std::move(exact));
    }
    return figure;
}

}  // namespace

report::Figure study_figure(const study::Study& study, const study::Summary& summary) {
    report::Figure figure;
    using Style = report::Curve::Style;
    if (!summary.arms.front().sweep.empty()) return sweep_figure(study, summary);
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
