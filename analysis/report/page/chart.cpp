#include "analysis/report/page/chart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "analysis/report/page/html.hpp"

namespace ringlock::report {

namespace {

using Style = Curve::Style;

void check_lengths(const Curve& curve) {
    const auto fits = [&](const std::vector<double>& v) { return v.empty() || v.size() == curve.x.size(); };
    if (curve.y.size() == curve.x.size() && fits(curve.lo) && fits(curve.hi)) return;
    throw std::invalid_argument("the vectors of a curve differ in length");
}

std::vector<Look> looks_of(const std::vector<Curve>& curves) {
    const auto dashed =
        std::count_if(curves.begin(), curves.end(), [](const Curve& c) { return c.style == Style::dashed; });
    std::vector<Look> looks;
    int next = 0;
    int bands = 0;
    int lines = 0;
    for (const Curve& curve : curves) {
        Look look;
        if (curve.style == Style::band) {
            look.colour = bands++;
        } else if (curve.style == Style::dashed) {
            // One curve of theory is that of all others; of several each belongs to the curve before it.
            look.colour = dashed == 1 ? Look::neutral : std::max(0, next - 1);
            look.dash = 1;
        } else {
            look.colour = next++;
            if (curve.style == Style::line) look.dash = lines++ % 4;
        }
        if (curve.colour) {
            look.colour = static_cast<int>(*curve.colour);
            look.dash = curve.style == Style::dashed ? 1 : 0;
        }
        look.marker = std::max(0, look.colour) % 7;
        if (look.colour != Look::neutral) look.colour %= Look::colours;
        looks.push_back(look);
    }
    return looks;
}

/// Ends of the error bars that the axis should reach: those far below all values would only stretch a logarithmic one.
std::vector<double> values_of(const Figure& figure) {
    std::vector<double> values;
    double least = INFINITY;
    for (const Curve& curve : figure.curves) {
        values.insert(values.end(), curve.y.begin(), curve.y.end());
        for (const double y : curve.y) {
            if (std::isfinite(y) && y > 0.0) least = std::min(least, y);
        }
    }
    for (const Curve& curve : figure.curves) {
        for (const double lo : curve.lo) {
            if (std::isfinite(lo)) values.push_back(figure.log_y ? std::max(lo, least / 3.0) : lo);
        }
        for (const double hi : curve.hi) {
            if (std::isfinite(hi)) values.push_back(hi);
        }
    }
    return values;
}

std::string range_text(const std::string& label, double lo, double hi, bool logarithmic) {
    return fmt::format("{} from {:.4g} to {:.4g}{}", label, lo, hi, logarithmic ? ", logarithmic" : "");
}

std::string value_cell(double value) { return std::isfinite(value) ? fmt::format("{:.6g}", value) : ""; }

}  // namespace

Chart::Chart(Figure figure) : figure_(std::move(figure)) {
    for (const Curve& curve : figure_.curves) check_lengths(curve);
    looks_ = looks_of(figure_.curves);
    std::vector<double> x;
    for (const Curve& curve : figure_.curves) x.insert(x.end(), curve.x.begin(), curve.x.end());
    x_range_ = axis_range(x, figure_.log_x);
    y_range_ = axis_range(values_of(figure_), figure_.log_y);
}

bool Chart::shows(double x, double y) const {
    return std::isfinite(x) && std::isfinite(y) && (!figure_.log_x || x > 0.0) && (!figure_.log_y || y > 0.0);
}

std::size_t Chart::shown_points(const Curve& curve) const {
    std::size_t count = 0;
    for (std::size_t i = 0; i < curve.x.size(); ++i) count += shows(curve.x[i], curve.y[i]) ? 1 : 0;
    return count;
}

std::string Chart::description() const {
    std::string text = fmt::format("Horizontal axis: {}. Vertical axis: {}.",
                                   range_text(figure_.x_label, x_range_.lo, x_range_.hi, figure_.log_x),
                                   range_text(figure_.y_label, y_range_.lo, y_range_.hi, figure_.log_y));
    for (const Curve& curve : figure_.curves) {
        if (!curve.in_legend()) continue;
        std::size_t first = curve.x.size();
        std::size_t last = 0;
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            if (!shows(curve.x[i], curve.y[i])) continue;
            first = std::min(first, i);
            last = i;
        }
        if (first == curve.x.size()) {
            text += fmt::format(" {}: no points.", curve.label);
            continue;
        }
        text += fmt::format(" {}: {} points from {:.4g} at {:.4g} to {:.4g} at {:.4g}.", curve.label,
                            shown_points(curve), curve.y[first], curve.x[first], curve.y[last], curve.x[last]);
    }
    return text;
}

std::string chart_table(const Chart& chart) {
    const Figure& figure = chart.figure();
    const bool bars = std::any_of(figure.curves.begin(), figure.curves.end(),
                                  [](const Curve& c) { return !c.lo.empty() || !c.hi.empty(); });
    std::string html = fmt::format(
        "<table><thead><tr><th scope=\"col\">curve</th><th scope=\"col\" class=\"n\">{}</th>"
        "<th scope=\"col\" class=\"n\">{}</th>{}</tr></thead><tbody>\n",
        html_escaped(figure.x_label), html_escaped(figure.y_label),
        bars ? "<th scope=\"col\" class=\"n\">from</th><th scope=\"col\" class=\"n\">to</th>" : "");
    for (const Curve& curve : figure.curves) {
        if (!curve.in_legend()) continue;
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            if (!std::isfinite(curve.x[i]) || !std::isfinite(curve.y[i])) continue;
            html += fmt::format("<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>",
                                html_escaped(curve.label), value_cell(curve.x[i]), value_cell(curve.y[i]));
            if (bars) {
                html += fmt::format("<td class=\"n\">{}</td><td class=\"n\">{}</td>",
                                    curve.lo.empty() ? "" : value_cell(curve.lo[i]),
                                    curve.hi.empty() ? "" : value_cell(curve.hi[i]));
            }
            html += "</tr>\n";
        }
    }
    return html + "</tbody></table>\n";
}

nlohmann::ordered_json chart_json(const Chart& chart, const std::string& id) {
    using Json = nlohmann::ordered_json;
    const Figure& figure = chart.figure();
    const auto rounded = [](double value) { return std::stod(fmt::format("{:.6g}", value)); };
    Json json{{"id", id},
              {"x", {{"label", figure.x_label}, {"log", figure.log_x}, {"whole", figure.whole_x}}},
              {"y", {{"label", figure.y_label}, {"log", figure.log_y}}},
              {"curves", Json::array()}};
    json["x"]["range"] = {rounded(chart.x_range().lo), rounded(chart.x_range().hi)};
    json["y"]["range"] = {rounded(chart.y_range().lo), rounded(chart.y_range().hi)};
    // One row for each x; a curve that comes to an x again, as a vertical line does, has a further row.
    std::map<std::pair<double, std::size_t>, std::vector<Json>> rows;
    const std::size_t curves = figure.curves.size();
    for (std::size_t c = 0; c < curves; ++c) {
        const Curve& curve = figure.curves[c];
        const Look& look = chart.looks()[c];
        json["curves"].push_back({{"label", curve.label},
                                  {"style", curve.style == Style::points ? "points"
                                            : curve.style == Style::band ? "band"
                                                                         : "line"},
                                  {"colour", look.colour},
                                  {"marker", look.marker},
                                  {"dash", look.dash}});
        std::map<double, std::size_t> times;
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            if (!chart.shows(curve.x[i], curve.y[i])) continue;
            const double x = rounded(curve.x[i]);
            const double y = rounded(curve.y[i]);
            std::vector<Json>& row = rows[{x, times[x]++}];
            row.resize(curves);
            const auto end = [&](const std::vector<double>& ends, double axis) {
                if (ends.empty() || !std::isfinite(ends[i])) return y;
                // Beyond the axis a bar ends at it; a logarithmic axis has no other place for it.
                return figure.log_y && ends[i] <= 0.0 ? axis : rounded(ends[i]);
            };
            row[c] = {end(curve.lo, json["y"]["range"][0].get<double>()), y,
                      end(curve.hi, json["y"]["range"][1].get<double>())};
        }
    }
    json["rows"] = Json::array();
    for (const auto& [key, values] : rows) {
        Json row = Json::array({key.first});
        for (const Json& value : values) row.push_back(value);
        json["rows"].push_back(std::move(row));
    }
    return json;
}

}  // namespace ringlock::report
