#include "app/report/lot_distribution.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "analysis/study/figures/lot_figures.hpp"

namespace ringlock::app {

namespace {

using report::Curve;
using report::Figure;

constexpr std::size_t fewest_gyros = 4;
constexpr std::size_t most_points = 128;  // of a curve

/// Values against the share of the gyros that have at most as much, at the middle of each gyro's step. An arm has the
/// colour of its number, so that it looks the same in all figures of a page.
Curve distribution(const std::string& name, std::size_t arm, std::vector<double> values) {
    const std::size_t all = values.size();
    std::erase_if(values, [](double value) { return !std::isfinite(value); });
    std::sort(values.begin(), values.end());
    Curve curve{.label = name, .style = Curve::Style::points, .colour = arm};
    const std::size_t points = std::min(values.size(), most_points);
    for (std::size_t i = 0; i < points; ++i) {
        const std::size_t gyro = points < 2 ? 0 : i * (values.size() - 1) / (points - 1);
        curve.x.push_back(values[gyro]);
        curve.y.push_back((static_cast<double>(gyro) + 0.5) / static_cast<double>(all));
    }
    return curve;
}

void add_limit(double x, const std::string& label, Figure& figure) {
    figure.curves.push_back({.label = label, .x = {x, x}, .y = {0.0, 1.0}, .style = Curve::Style::dashed});
}

/// Whether a logarithmic axis shows the values better.
bool is_wide(const Figure& figure) {
    constexpr double decades_of_a_linear_axis = 5.0;
    double lo = INFINITY;
    double hi = 0.0;
    for (const Curve& curve : figure.curves) {
        for (const double x : curve.x) {
            lo = std::min(lo, x);
            hi = std::max(hi, x);
        }
    }
    return lo > 0.0 && hi > decades_of_a_linear_axis * lo;
}

}  // namespace

std::vector<Figure> lot_distributions(const study::Study& study, const study::Summary& summary) {
    std::vector<Figure> figures;
    if (!summary.arms.front().sweep.empty() || study.gyros.size() < fewest_gyros) return figures;
    const auto add = [&](const std::string& name, const std::string& title, const std::string& label) {
        Figure figure{.title = title, .x_label = label, .y_label = "share of the gyros with at most that"};
        for (std::size_t a = 0; a < summary.arms.size(); ++a) {
            const study::ArmSummary& arm = summary.arms[a];
            if (name == "arw_deg_rt_h" && !study::has_arw(arm)) continue;
            for (study::LotValues& values : study::lot_values(study, study.arms[a])) {
                if (values.name == name) figure.curves.push_back(distribution(arm.name, a, std::move(values.values)));
            }
        }
        if (figure.curves.empty()) return;
        if (summary.arms.front().yield) {
            for (const study::LimitYield& limit : summary.arms.front().yield->limits) {
                if (limit.name != name) continue;
                add_limit(limit.most, fmt::format("limit {:g}", limit.most), figure);
                if (name == "rate_error_deg_h") add_limit(-limit.most, "", figure);
            }
        }
        figure.log_x = is_wide(figure);
        figures.push_back(std::move(figure));
    };
    add("arw_deg_rt_h", "Angle random walk over the gyros", "angle random walk [deg/sqrt(h)]");
    add("rate_error_deg_h", "Mean rate error over the gyros", "mean rate less the input rate [deg/h]");
    const scenario::Specification& wanted = study.scenario.specification;
    if (wanted.bias_stability_deg_h > 0.0) {
        add(fmt::format("allan_deviation_{:g}_s_deg_h", wanted.at_s),
            fmt::format("Allan deviation at {:g} s over the gyros", wanted.at_s),
            fmt::format("Allan deviation at {:g} s [deg/h]", wanted.at_s));
    }
    if (wanted.angle_error_arcsec > 0.0) {
        add(fmt::format("angle_error_{:g}_s_arcsec", wanted.after_s),
            fmt::format("Angle error after {:g} s over the gyros", wanted.after_s), "angle error [arcsec]");
    }
    return figures;
}

}  // namespace ringlock::app
