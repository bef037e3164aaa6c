#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "analysis/report/code_points.hpp"
#include "analysis/report/page/chart.hpp"
#include "analysis/report/page/html.hpp"

namespace ringlock::report {

namespace {

using Style = Curve::Style;

// Units of the drawing, which the page scales to the width of the screen.
constexpr double width = 760.0;
constexpr double height = 430.0;
constexpr double digit_width = 7.8;  // of tick labels of 14 units

/// A coordinate in tenths, without trailing zeros.
std::string coordinate(double value) {
    const double tenths = std::round(10.0 * value);
    return fmt::format("{:g}", tenths == 0.0 ? 0.0 : tenths / 10.0);
}

/// Places of values on the drawing.
struct Frame {
    double left, right, top, bottom;
    AxisRange x_range, y_range;
    bool log_x, log_y;

    static double share(double value, AxisRange range, bool logarithmic) {
        if (!logarithmic) return (value - range.lo) / (range.hi - range.lo);
        return (std::log(value) - std::log(range.lo)) / (std::log(range.hi) - std::log(range.lo));
    }
    double x(double value) const { return left + (right - left) * share(value, x_range, log_x); }
    double y(double value) const { return bottom - (bottom - top) * share(value, y_range, log_y); }
    /// The end of an error bar, at most the end of the axis.
    double end(double value) const {
        if (log_y && value <= 0.0) return bottom;
        return std::clamp(y(value), top, bottom);
    }
};

std::string colour_class(const Look& look) {
    return look.colour == Look::neutral ? "ct" : fmt::format("c{}", look.colour);
}

/// The marker about a point, as part of a path.
std::string marker_path(int marker, double x, double y) {
    const std::string at = coordinate(x) + " " + coordinate(y);
    switch (marker) {
        case 0:
            return fmt::format("M{} {}a3.4 3.4 0 1 0 6.8 0a3.4 3.4 0 1 0-6.8 0", coordinate(x - 3.4), coordinate(y));
        case 1:
            return fmt::format("M{}m-3.2-3.2h6.4v6.4h-6.4z", at);
        case 2:
            return fmt::format("M{}m0-4.4l4 7h-8z", at);
        case 3:
            return fmt::format("M{}m0-4.6l4.6 4.6l-4.6 4.6l-4.6-4.6z", at);
        case 4:
            return fmt::format("M{}m0 4.4l4-7h-8z", at);
        case 5:
            return fmt::format(
                "M{}m-3.6-2.2l1.4-1.4l2.2 2.2l2.2-2.2l1.4 1.4l-2.2 2.2l2.2 2.2l-1.4 1.4l-2.2-2.2l-2.2 "
                "2.2l-1.4-1.4l2.2-2.2z",
                at);
        default:
            return fmt::format("M{}m-1-4.4h2v3.4h3.4v2h-3.4v3.4h-2v-3.4h-3.4v-2h3.4z", at);
    }
}

/// Places of the points of a curve, in stretches between those that cannot be shown.
std::vector<std::vector<std::size_t>> stretches(const Chart& chart, const Curve& curve) {
    std::vector<std::vector<std::size_t>> all;
    bool inside = false;
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
        if (!chart.shows(curve.x[i], curve.y[i])) {
            inside = false;
            continue;
        }
        if (!inside) all.emplace_back();
        inside = true;
        all.back().push_back(i);
    }
    return all;
}

std::string line_svg(const Chart& chart, const Frame& frame, const Curve& curve, const Look& look) {
    std::string svg;
    for (const auto& stretch : stretches(chart, curve)) {
        std::string points;
        for (const std::size_t i : stretch) {
            points += fmt::format("{}{},{}", points.empty() ? "" : " ", coordinate(frame.x(curve.x[i])),
                                  coordinate(frame.y(curve.y[i])));
        }
        const char* thin = curve.colour ? " thin" : "";
        svg += fmt::format("<polyline class=\"line {} d{}{}\" points=\"{}\"/>\n", colour_class(look), look.dash, thin,
                           points);
    }
    return svg;
}

std::string band_svg(const Chart& chart, const Frame& frame, const Curve& curve, const Look& look) {
    std::string svg;
    for (const auto& stretch : stretches(chart, curve)) {
        std::string points;
        const auto add = [&](std::size_t i, double value) {
            points += fmt::format("{}{},{}", points.empty() ? "" : " ", coordinate(frame.x(curve.x[i])),
                                  coordinate(frame.end(value)));
        };
        for (auto i = stretch.begin(); i != stretch.end(); ++i) add(*i, curve.lo.empty() ? curve.y[*i] : curve.lo[*i]);
        for (auto i = stretch.rbegin(); i != stretch.rend(); ++i) {
            add(*i, curve.hi.empty() ? curve.y[*i] : curve.hi[*i]);
        }
        svg += fmt::format("<polygon class=\"band {}\" points=\"{}\"/>\n", colour_class(look), points);
    }
    return svg;
}

std::string points_svg(const Chart& chart, const Frame& frame, const Curve& curve, const Look& look) {
    std::string bars;
    std::string markers;
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
        if (!chart.shows(curve.x[i], curve.y[i])) continue;
        const double x = frame.x(curve.x[i]);
        const double y = frame.y(curve.y[i]);
        markers += marker_path(look.marker, x, y);
        for (const auto* ends : {&curve.lo, &curve.hi}) {
            if (ends->empty() || !std::isfinite((*ends)[i])) continue;
            const std::string end = coordinate(frame.end((*ends)[i]));
            bars += fmt::format("M{} {}V{}M{} {}h6", coordinate(x), coordinate(y), end, coordinate(x - 3.0), end);
        }
    }
    std::string svg;
    if (!bars.empty()) svg += fmt::format("<path class=\"bar {}\" d=\"{}\"/>\n", colour_class(look), bars);
    if (!markers.empty()) svg += fmt::format("<path class=\"mark {}\" d=\"{}\"/>\n", colour_class(look), markers);
    return svg;
}

std::string curves_svg(const Chart& chart, const Frame& frame) {
    std::string svg;
    const auto draw = [&](auto&& wanted, auto&& one) {
        for (std::size_t c = 0; c < chart.figure().curves.size(); ++c) {
            const Curve& curve = chart.figure().curves[c];
            if (wanted(curve.style)) svg += one(chart, frame, curve, chart.looks()[c]);
        }
    };
    draw([](Style s) { return s == Style::band; }, band_svg);
    draw([](Style s) { return s == Style::line; }, line_svg);
    draw([](Style s) { return s == Style::points; }, points_svg);
    draw([](Style s) { return s == Style::dashed; }, line_svg);
    return svg;
}

std::string axes_svg(const Figure& figure, const Frame& frame, const Ticks& x, const Ticks& y) {
    std::string grid;
    std::string marks;
    std::string labels;
    for (const double value : x.major) {
        const std::string at = coordinate(frame.x(value));
        grid += fmt::format("M{} {}V{}", at, coordinate(frame.top), coordinate(frame.bottom));
        labels += fmt::format("<text class=\"tick\" text-anchor=\"middle\" x=\"{}\" y=\"{}\">{}</text>\n", at,
                              coordinate(frame.bottom + 20.0), tick_label(value));
    }
    for (const double value : x.minor) {
        marks += fmt::format("M{} {}v-5", coordinate(frame.x(value)), coordinate(frame.bottom));
    }
    for (const double value : y.major) {
        const double at = frame.y(value);
        grid += fmt::format("M{} {}H{}", coordinate(frame.left), coordinate(at), coordinate(frame.right));
        labels += fmt::format("<text class=\"tick\" text-anchor=\"end\" x=\"{}\" y=\"{}\">{}</text>\n",
                              coordinate(frame.left - 8.0), coordinate(at + 5.0), tick_label(value));
    }
    for (const double value : y.minor) {
        marks += fmt::format("M{} {}h5", coordinate(frame.left), coordinate(frame.y(value)));
    }
    std::string svg = fmt::format("<path class=\"grid\" d=\"{}\"/>\n", grid);
    svg +=
        fmt::format("<path class=\"axis\" d=\"M{} {}H{}V{}H{}z{}\"/>\n", coordinate(frame.left), coordinate(frame.top),
                    coordinate(frame.right), coordinate(frame.bottom), coordinate(frame.left), marks);
    svg += labels;
    svg += fmt::format("<text class=\"label\" text-anchor=\"middle\" x=\"{}\" y=\"{}\">{}</text>\n",
                       coordinate(0.5 * (frame.left + frame.right)), coordinate(height - 8.0),
                       html_escaped(figure.x_label));
    svg += fmt::format(
        "<text class=\"label\" text-anchor=\"middle\" transform=\"translate(16 {}) rotate(-90)\">{}</text>\n",
        coordinate(0.5 * (frame.top + frame.bottom)), html_escaped(figure.y_label));
    return svg;
}

}  // namespace

std::string chart_svg(const Chart& chart, const std::string& id) {
    const Figure& figure = chart.figure();
    constexpr int most_x = 9;
    constexpr int most_y = 7;
    const AxisRange xr = chart.x_range();
    const AxisRange yr = chart.y_range();
    const Ticks x = figure.log_x ? log_ticks(xr, most_x) : linear_ticks(xr, most_x, figure.whole_x);
    const Ticks y = figure.log_y ? log_ticks(yr, most_y) : linear_ticks(yr, most_y);
    std::size_t longest = 1;
    for (const double value : y.major) longest = std::max(longest, code_points(tick_label(value)));
    const Frame frame{38.0 + digit_width * static_cast<double>(longest),
                      width - 22.0,
                      12.0,
                      height - 54.0,
                      xr,
                      yr,
                      figure.log_x,
                      figure.log_y};
    std::string svg = fmt::format(
        "<svg role=\"img\" aria-labelledby=\"{0}-title {0}-desc\" viewBox=\"0 0 {1:g} {2:g}\">\n"
        "<title id=\"{0}-title\">{3}</title>\n<desc id=\"{0}-desc\">{4}</desc>\n",
        id, width, height, html_escaped(figure.title), html_escaped(chart.description()));
    return svg + axes_svg(figure, frame, x, y) + curves_svg(chart, frame) + "</svg>\n";
}

std::string chart_legend(const Chart& chart) {
    std::string html = "<ul class=\"legend\">\n";
    for (std::size_t c = 0; c < chart.figure().curves.size(); ++c) {
        const Curve& curve = chart.figure().curves[c];
        if (!curve.in_legend()) continue;
        const Look& look = chart.looks()[c];
        std::string key;
        if (curve.style == Style::band) {
            key = fmt::format("<path class=\"band {}\" d=\"M2 2h26v12h-26z\"/>", colour_class(look));
        } else if (curve.style == Style::points) {
            key = fmt::format("<path class=\"mark {}\" d=\"{}\"/>", colour_class(look),
                              marker_path(look.marker, 15.0, 8.0));
        } else {
            key = fmt::format("<path class=\"line {} d{}\" d=\"M1 8h28\"/>", colour_class(look), look.dash);
        }
        html += fmt::format("<li><svg class=\"key\" aria-hidden=\"true\" viewBox=\"0 0 30 16\">{}</svg>{}{}</li>\n",
                            key, html_escaped(curve.label), chart.shown_points(curve) == 0 ? " (no points)" : "");
    }
    return html + "</ul>\n";
}

}  // namespace ringlock::report
