#include "app/allan/output/allan_figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/noise/allan_variance.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

using Style = report::Curve::Style;

/// Whether the terms of the noise are those of what the estimator estimates.
bool estimates_allan_variance(allan::Estimator e) {
    return e == allan::Estimator::adev || e == allan::Estimator::oadev || e == allan::Estimator::totdev;
}

report::Curve curve_of(allan::Estimator estimator, const std::vector<allan::Point>& points) {
    report::Curve curve{std::string(allan::name(estimator)), {}, {}, {}, {}, Style::points};
    for (const allan::Point& p : points) {
        curve.x.push_back(p.tau_s);
        curve.y.push_back(p.dev);
        curve.lo.push_back(p.lo);
        curve.hi.push_back(p.hi);
    }
    return curve;
}

/// From the first to the last, close enough that a sinusoid is seen as one.
std::vector<double> fine_grid(double first_s, double last_s) {
    constexpr double points_per_decade = 60.0;
    const double decades = std::log10(last_s / first_s);
    const auto steps = static_cast<int>(std::ceil(points_per_decade * decades));
    std::vector<double> out = {first_s};
    for (int i = 1; i <= steps; ++i) out.push_back(first_s * std::pow(10.0, decades * i / steps));
    return out;
}

/// Deviations of all terms together.
std::vector<double> sums_of(const std::vector<noise::VarianceTerm>& terms, std::size_t size) {
    std::vector<double> out(size);
    for (const noise::VarianceTerm& term : terms) {
        for (std::size_t i = 0; i < size; ++i) out[i] += term.variances[i];
    }
    for (double& y : out) y = std::sqrt(y);
    return out;
}

void add_fit(const AllanOutput& out, const std::vector<double>& tau_s, report::Figure& figure) {
    const auto terms = noise::variance_terms(*out.noise, tau_s);
    if (terms.empty()) return;
    double least = figure.curves.front().y.front();
    for (const report::Curve& c : figure.curves) least = std::min(least, *std::min_element(c.y.begin(), c.y.end()));
    for (const noise::VarianceTerm& term : terms) {
        report::Curve line{term.name, {}, {}, {}, {}, Style::line};
        for (std::size_t i = 0; i < tau_s.size(); ++i) {
            const double dev = std::sqrt(term.variances[i]);
            // Far below the curve a line only stretches the axis.
            if (dev < 0.3 * least) continue;
            line.x.push_back(tau_s[i]);
            line.y.push_back(dev);
        }
        figure.curves.push_back(std::move(line));
    }
    figure.curves.push_back({"fit", tau_s, sums_of(terms, tau_s.size()), {}, {}, Style::dashed});
}

}  // namespace

void set_axes(const AllanOutput& out, report::Figure& figure) {
    const bool times = std::all_of(out.deviations.begin(), out.deviations.end(),
                                   [](const auto& d) { return allan::traits(d.estimator).time; });
    const bool rates = std::none_of(out.deviations.begin(), out.deviations.end(),
                                    [](const auto& d) { return allan::traits(d.estimator).time; });
    figure.x_label = "averaging time tau [s]";
    figure.y_label = "deviation";
    if (out.instrument) {
        const InstrumentNames& names = names_of(*out.instrument);
        const std::string_view rate = names.rate_unit.empty() ? "1" : names.rate_unit;
        figure.y_label = times   ? fmt::format("deviation [{}]", names.integral_unit)
                         : rates ? fmt::format("deviation [{}]", rate)
                                 : fmt::format("deviation [{}; times: {}]", rate, names.integral_unit);
    }
    figure.log_x = figure.log_y = true;
}

void add_series(const AllanOutput& out, const std::string& name, report::Figure& figure) {
    std::vector<double> tau_s;
    std::size_t colour = 0;
    for (const DeviationOutput& d : out.deviations) {
        if (d.points.empty()) continue;
        const std::size_t rank = static_cast<std::size_t>(std::count_if(
            figure.curves.begin(), figure.curves.end(), [](const auto& c) { return c.style == Style::points; }));
        figure.curves.push_back(curve_of(d.estimator, d.points));
        report::Curve& curve = figure.curves.back();
        curve.label = out.deviations.size() == 1 ? name : fmt::format("{}, {}", name, allan::name(d.estimator));
        curve.colour = rank;
        if (estimates_allan_variance(d.estimator) && curve.x.size() > tau_s.size()) {
            tau_s = curve.x;
            colour = rank;
        }
    }
    if (!out.noise || !out.noise->described || tau_s.empty()) return;
    const std::vector<double> fine = fine_grid(tau_s.front(), tau_s.back());
    const auto terms = noise::variance_terms(*out.noise, fine);
    if (terms.empty()) return;
    report::Curve sum{"", fine, sums_of(terms, fine.size()), {}, {}, Style::line};
    sum.colour = colour;
    figure.curves.push_back(std::move(sum));
}

report::Figure allan_figure(const AllanOutput& out) {
    report::Figure figure;
    figure.title = fmt::format("{}, column {}", printable(out.data), printable(out.column));
    set_axes(out, figure);
    std::vector<double> tau_s;
    for (const DeviationOutput& d : out.deviations) {
        if (d.points.empty()) continue;
        figure.curves.push_back(curve_of(d.estimator, d.points));
        if (estimates_allan_variance(d.estimator) && figure.curves.back().x.size() > tau_s.size()) {
            tau_s = figure.curves.back().x;
        }
    }
    if (out.noise && out.noise->described && !tau_s.empty())
        add_fit(out, fine_grid(tau_s.front(), tau_s.back()), figure);
    return figure;
}

}  // namespace ringlock::app
