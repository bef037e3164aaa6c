#include "analysis/report/map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/report/gnuplot.hpp"

namespace ringlock::report {
namespace {

constexpr int map_width_px = 900;
constexpr int panel_height_px = 380;
constexpr int map_title_px = 60;

/// Lightness rises evenly along it, for readers who see colours otherwise and for print in grey.
constexpr const char* palette =
    "set palette defined (0 '#440154', 1 '#46327e', 2 '#365c8d', 3 '#277f8e', 4 '#1fa187', 5 '#4ac16d', 6 '#a0da39', "
    "7 '#fde725')\n";

struct Range {
    double lowest = std::numeric_limits<double>::infinity();
    double highest = -std::numeric_limits<double>::infinity();

    void include(double v) {
        lowest = std::min(lowest, v);
        highest = std::max(highest, v);
    }
};

bool is_shown(const MapPanel::Cell& cell) { return cell.value > 0.0 && std::isfinite(cell.value); }

std::string block_of(const MapPanel& panel, std::size_t index) {
    std::string out = fmt::format("$panel{} << END\n", index);
    for (const MapPanel::Cell& cell : panel.cells) {
        if (!is_shown(cell)) continue;
        const auto row = static_cast<double>(cell.row);
        out += fmt::format("{} {} {} {} {} {} {}\n", 0.5 * (cell.begin + cell.end), row, cell.begin, cell.end,
                           row - 0.5, row + 0.5, cell.value);
    }
    return out + "END\n";
}

/// As gnuplot labels its own axes: in plain notation from 1e-4 to 1e5, as m×10^k beyond.
std::string label_of(double value) {
    const int decade = static_cast<int>(std::floor(std::log10(value)));
    if (decade >= -4 && decade < 5) return fmt::format("{:.{}g}", value, std::max(3, decade + 1));
    return fmt::format("{:.3g}×10^{{{}}}", value / std::pow(10.0, decade), decade);
}

/// 1, 2 and 5 of each decade within the range; of a long range some of its decades, of a short one its ends.
std::string colour_tics(const Range& range) {
    constexpr double most_with_three = 3.0;
    constexpr double most_decades = 10.0;
    const double decades = std::log10(range.highest) - std::log10(range.lowest);
    const int step = std::max(1, static_cast<int>(std::ceil(decades / most_decades)));
    const std::vector<double> digits = decades > most_with_three ? std::vector{1.0} : std::vector{1.0, 2.0, 5.0};
    std::vector<double> values;
    for (int decade = static_cast<int>(std::floor(std::log10(range.lowest))); std::pow(10.0, decade) <= range.highest;
         decade += step) {
        for (const double digit : digits) {
            const double value = digit * std::pow(10.0, decade);
            if (value >= range.lowest && value <= range.highest) values.push_back(value);
        }
    }
    if (values.size() < 2) values = {range.lowest, range.highest};
    std::string out;
    for (const double value : values) {
        out += fmt::format("{}'{}' {}", out.empty() ? "" : ", ", label_of(value), value);
    }
    return out;
}

std::string row_tics(const std::vector<std::string>& rows) {
    std::string out;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        out += fmt::format("{}{} {}", i == 0 ? "" : ", ", literal(rows[i]), i);
    }
    return out;
}

}  // namespace

std::string draw_map(const Map& map, const std::string& shown_as) {
    Range x;
    Range colour;
    for (const MapPanel& panel : map.panels) {
        for (const MapPanel::Cell& cell : panel.cells) {
            x.include(cell.begin);
            x.include(cell.end);
            if (is_shown(cell)) colour.include(cell.value);
        }
    }
    if (!(x.lowest < x.highest)) x = {0.0, 1.0};
    if (!(colour.lowest <= colour.highest)) colour = {1.0, 10.0};
    if (!(colour.lowest < colour.highest)) colour = {0.9 * colour.lowest, 1.1 * colour.highest};
    const auto panels = static_cast<int>(std::max<std::size_t>(1, map.panels.size()));
    std::string script = fmt::format(
        "set encoding utf8\n"
        "set terminal svg size {},{} fixed enhanced background '#ffffff' font 'Helvetica,Arial,sans-serif,16'\n"
        "{}set logscale cb\nset cbrange [{}:{}]\nset cbtics ({})\nset cblabel {} noenhanced offset 1,0\n"
        "set xrange [{}:{}]\nset yrange [-0.5:{}]\nset ytics ({}) noenhanced\nset xtics nomirror\n"
        "set xlabel {} noenhanced\nset ylabel {} noenhanced\nset border 3 linecolor '#444444'\nunset key\n",
        map_width_px, map_title_px + panels * panel_height_px, palette, colour.lowest, colour.highest,
        colour_tics(colour), literal(map.colour_label), x.lowest, x.highest, static_cast<double>(map.rows.size()) - 0.5,
        row_tics(map.rows), literal(map.x_label), literal(map.y_label));
    for (std::size_t i = 0; i < map.panels.size(); ++i) script += block_of(map.panels[i], i);
    script += fmt::format("set multiplot layout {},1 title {} noenhanced font ',19'\n", panels, literal(map.title));
    for (std::size_t i = 0; i < map.panels.size(); ++i) {
        const bool any = std::any_of(map.panels[i].cells.begin(), map.panels[i].cells.end(), is_shown);
        script += fmt::format("set title {} noenhanced font ',16'\n",
                              literal(map.panels[i].title + (any ? "" : " (nothing to show)")));
        script += any ? fmt::format(
                            "plot $panel{} using 1:2:3:4:5:6:7 with boxxyerror fillstyle solid 1.0 noborder "
                            "fillcolor palette\n",
                            i)
                      : "plot NaN\n";
    }
    return run_gnuplot(script + "unset multiplot\n", shown_as);
}

}  // namespace ringlock::report
