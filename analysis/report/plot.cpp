#include "analysis/report/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "analysis/report/code_points.hpp"
#include "analysis/report/gnuplot.hpp"
#include "analysis/report/render.hpp"
#include "engine/core/error.hpp"

namespace ringlock::report {
namespace {

constexpr int width_px = 900;
constexpr int height_px = 620;
constexpr int legend_row_px = 24;

// Okabe and Ito, distinguishable for the colour-blind too; black is kept for theory, yellow is too pale on white.
constexpr std::array<std::string_view, 6> colours = {"#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"};
constexpr std::array<std::string_view, 3> theory_colours = {"#000000", "#666666", "#999999"};
struct Marker {
    int type;     ///< of gnuplot's svg terminal
    double size;  ///< times gnuplot's own
};
// Large open markers and small filled ones by turns, so that curves lying on each other show through. Seven against six
// colours: a pair comes back only after 42 curves.
constexpr std::array<Marker, 7> markers = {{{6, 1.35}, {5, 0.8}, {8, 1.4}, {13, 0.8}, {4, 1.15}, {7, 0.55}, {10, 1.1}}};
constexpr std::array<std::string_view, 3> dashes = {"(12,6)", "(4,4)", "(14,4,3,4)"};

/// Breaks a title that one line cannot hold at blanks.
std::string literal_lines(std::string_view text, std::size_t limit) {
    std::string out;
    while (code_points(text) > limit) {
        std::size_t cut = std::string_view::npos;
        for (std::size_t i = 0; i < text.size() && code_points(text.substr(0, i)) <= limit; ++i) {
            if (text[i] == ' ') cut = i;
        }
        if (cut == std::string_view::npos) break;
        out += literal(text.substr(0, cut)) + ".\"\\n\".";
        text.remove_prefix(cut + 1);
    }
    return out + literal(text);
}

class Axis {
   public:
    explicit Axis(bool log) : log_(log) {}

    bool shows(double v) const { return std::isfinite(v) && (!log_ || v > 0.0); }

    /// Widens the range to a point.
    void include(double v) {
        lowest_ = std::min(lowest_, v);
        highest_ = std::max(highest_, v);
    }
    /// Widens the range to the end of an error bar, on a logarithmic axis to a decade beyond the points at most.
    void include_bar(double v) {
        if (!std::isfinite(v)) return;
        bar_lowest_ = std::min(bar_lowest_, v);
        bar_highest_ = std::max(bar_highest_, v);
    }

    /// Sets the range with some room at both ends. To be called once, before the functions below.
    void settle() {
        if (lowest_ > highest_) {
            lowest_ = log_ ? 1.0 : 0.0;
            highest_ = log_ ? 10.0 : 1.0;
        }
        if (log_) {
            lowest_ = std::min(lowest_, std::max(bar_lowest_, lowest_ / 10.0));
            highest_ = std::max(highest_, std::min(bar_highest_, highest_ * 10.0));
            double room = 0.04 * std::log10(highest_ / lowest_);
            if (room < 0.05) room = 0.05;
            begin_ = std::max(lowest_ * std::pow(10.0, -room), std::numeric_limits<double>::min());
            end_ = std::min(highest_ * std::pow(10.0, room), std::numeric_limits<double>::max());
        } else {
            lowest_ = std::min(lowest_, bar_lowest_);
            highest_ = std::max(highest_, bar_highest_);
            const double size = std::max(std::abs(lowest_), std::abs(highest_));
            double room = 0.04 * (highest_ - lowest_);
            if (!(room > 1e-9 * size)) room = size > 0.0 ? 0.1 * size : 1.0;
            begin_ = lowest_ - room;
            end_ = highest_ + room;
        }
    }

    double begin() const { return begin_; }
    double end() const { return end_; }

    /// Settings of one axis, "x" or "y".
    std::string settings(std::string_view name) const {
        std::string out = fmt::format("set {}range [{}:{}]\n", name, begin_, end_);
        if (!log_) return out + fmt::format("set m{}tics\nset format {} '%.10g'\n", name, name);
        return out + fmt::format("set logscale {}\nset {}tics ({})\n", name, name, tics());
    }

   private:
    // Explicit tics: gnuplot labels whole decades only, of which a short axis may have one or none.
    std::string tics() const {
        const int first = static_cast<int>(std::floor(std::log10(begin_)));
        const int last = static_cast<int>(std::ceil(std::log10(end_)));
        const double decades = std::log10(end_ / begin_);
        if (decades < 0.5) return even_tics();
        const int every = static_cast<int>(decades / 12.0) + 1;
        const bool plain = first >= -3 && last <= 5;
        std::string out;
        for (int decade = first; decade <= last; ++decade) {
            for (int digit = 1; digit <= 9; ++digit) {
                // Read from text: the double nearest to the decimal, without rounding of a power.
                const std::string text = fmt::format("{}e{}", digit, decade);
                const bool labelled =
                    digit == 1 ? decade % every == 0 : decades < 1.0 || (decades < 2.5 && (digit == 2 || digit == 5));
                if (every > 1 && digit > 1) continue;
                std::string label;
                if (labelled && plain) {
                    label = fmt::format("{:g}", std::stod(text));
                } else if (labelled) {
                    label = digit == 1 ? fmt::format("10^{{{}}}", decade) : fmt::format("{}·10^{{{}}}", digit, decade);
                }
                if (!out.empty()) out += ", ";
                out += fmt::format("'{}' {} {}", label, text, labelled ? 0 : 1);
            }
        }
        return out;
    }

    /// Some five evenly spaced ones, for an axis so short that it is nearly linear.
    std::string even_tics() const {
        const double rough = (end_ - begin_) / 5.0;
        const double power = std::pow(10.0, std::floor(std::log10(rough)));
        const double step = power * (rough < 2.0 * power ? 2.0 : rough < 5.0 * power ? 5.0 : 10.0);
        std::string out;
        for (double k = std::ceil(begin_ / step); k * step <= end_; ++k) {
            out += fmt::format("{}'{:.6g}' {}", out.empty() ? "" : ", ", k * step, k * step);
        }
        return out;
    }

    bool log_;
    double lowest_ = std::numeric_limits<double>::infinity();
    double highest_ = -std::numeric_limits<double>::infinity();
    double bar_lowest_ = std::numeric_limits<double>::infinity();
    double bar_highest_ = -std::numeric_limits<double>::infinity();
    double begin_ = 0.0;
    double end_ = 1.0;
};

void check(const Curve& curve) {
    const std::size_t n = curve.x.size();
    const bool bars = !curve.lo.empty() || curve.style == Curve::Style::band;
    if (curve.y.size() != n || curve.lo.size() != curve.hi.size() || (bars && curve.lo.size() != n)) {
        throw std::invalid_argument(fmt::format("curve \"{}\" has {} x, {} y, {} lo and {} hi", curve.label, n,
                                                curve.y.size(), curve.lo.size(), curve.hi.size()));
    }
}

struct Plotted {
    std::string data;   ///< block of gnuplot
    std::string plots;  ///< elements of the plot command
};

/// `rank` counts the curves of the same kind (dashed, bands, others), `above` the solid lines still to come.
Plotted plotted(const Curve& curve, std::size_t index, std::size_t rank, std::size_t above, const Axis& x,
                const Axis& y) {
    const bool bars = !curve.lo.empty();
    const bool dashed = curve.style == Curve::Style::dashed;
    const bool band = curve.style == Curve::Style::band;
    std::string rows;
    bool any = false;
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
        if (!x.shows(curve.x[i]) || !y.shows(curve.y[i])) {
            if (any && curve.style != Curve::Style::points) rows += '\n';  // a line has a gap there
            continue;
        }
        any = true;
        rows += fmt::format("{} {}", curve.x[i], curve.y[i]);
        if (bars) {
            const double lo = std::isnan(curve.lo[i]) ? curve.y[i] : std::clamp(curve.lo[i], y.begin(), y.end());
            const double hi = std::isnan(curve.hi[i]) ? curve.y[i] : std::clamp(curve.hi[i], y.begin(), y.end());
            rows += fmt::format(" {} {}", lo, hi);
        }
        rows += '\n';
    }
    const std::string_view colour =
        dashed ? theory_colours[rank % theory_colours.size()] : colours[curve.colour.value_or(rank) % colours.size()];
    const std::string title =
        curve.in_legend() ? "title " + literal(curve.label + (any ? "" : " (nothing to show)")) : "notitle";
    const std::string block = fmt::format("$curve{}", index);

    Plotted out;
    if (any) out.data = fmt::format("{} << END\n{}END\n", block, rows);
    if (any && bars && !band) {
        // Not yerrorbars, which clear the ground under the marker and with it the curves drawn before.
        out.plots = fmt::format("{} using 1:3:(0):($4-$3) with vectors nohead linewidth 1.5 linecolor '{}' notitle, ",
                                block, colour);
    }
    const std::string what = any ? block + " using 1:2" : "NaN";
    if (band) {
        // Its edges are drawn too: a narrow band would not be seen.
        for (const int edge : {3, 4}) {
            if (any) {
                out.plots +=
                    fmt::format("{} using 1:{} with lines linewidth 1.2 linecolor '{}' notitle, ", block, edge, colour);
            }
        }
        out.plots += fmt::format("{} with filledcurves fillstyle transparent solid 0.3 noborder linecolor '{}' {}",
                                 any ? block + " using 1:3:4" : "NaN", colour, title);
    } else if (curve.style == Curve::Style::points) {
        const Marker marker = markers[curve.colour.value_or(rank) % markers.size()];
        out.plots += fmt::format("{} with points pointtype {} pointsize {} linewidth 2 linecolor '{}' {}", what,
                                 marker.type, marker.size, colour, title);
    } else if (dashed) {
        out.plots += fmt::format("{} with lines dashtype {} linewidth 1.8 linecolor '{}' {}", what,
                                 dashes[rank % dashes.size()], colour, title);
    } else {
        const double wide = curve.colour ? 1.5 : std::min(5.0, 2.0 + 1.2 * static_cast<double>(above));
        out.plots += fmt::format("{} with lines linewidth {:.1f} linecolor '{}' {}", what, wide, colour, title);
    }
    return out;
}

std::string script(const Figure& figure) {
    Axis x(figure.log_x);
    Axis y(figure.log_y);
    std::size_t longest = 1;
    for (const Curve& curve : figure.curves) {
        check(curve);
        longest = std::max(longest, code_points(curve.label));
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            if (!x.shows(curve.x[i]) || !y.shows(curve.y[i])) continue;
            x.include(curve.x[i]);
            y.include(curve.y[i]);
            if (curve.style == Curve::Style::band) {
                if (y.shows(curve.lo[i])) y.include(curve.lo[i]);
                if (y.shows(curve.hi[i])) y.include(curve.hi[i]);
            } else if (!curve.lo.empty()) {
                y.include_bar(curve.lo[i]);
                y.include_bar(curve.hi[i]);
            }
        }
    }
    x.settle();
    y.settle();

    std::vector<const Curve*> order;
    for (const Curve& curve : figure.curves) order.push_back(&curve);
    std::stable_partition(order.begin(), order.end(), [](const Curve* c) { return c->style != Curve::Style::dashed; });
    std::stable_partition(order.begin(), order.end(), [](const Curve* c) { return c->style == Curve::Style::band; });

    std::string data;
    std::string plots;
    std::size_t solid = 0;
    std::size_t dashed = 0;
    std::size_t bands = 0;
    std::size_t lines = static_cast<std::size_t>(
        std::count_if(order.begin(), order.end(), [](const Curve* c) { return c->style == Curve::Style::line; }));
    for (std::size_t i = 0; i < order.size(); ++i) {
        if (order[i]->style == Curve::Style::line) --lines;
        const std::size_t rank = order[i]->style == Curve::Style::dashed ? dashed++
                                 : order[i]->style == Curve::Style::band ? bands++
                                                                         : solid++;
        const Plotted curve = plotted(*order[i], i, rank, lines, x, y);
        data += curve.data;
        plots += (i == 0 ? "" : ", ") + curve.plots;
    }
    if (plots.empty()) plots = "NaN notitle";

    const std::size_t columns = std::clamp<std::size_t>(900 / (70 + 8 * longest), 1, 3);
    const auto entries = static_cast<std::size_t>(
        std::count_if(order.begin(), order.end(), [](const Curve* c) { return c->in_legend(); }));
    const int rows = static_cast<int>((entries + columns - 1) / columns);
    const int height = height_px + legend_row_px * std::max(0, rows - 4);
    return fmt::format(
               "set encoding utf8\n"
               "set terminal svg size {},{} fixed enhanced background '#ffffff' font 'Helvetica,Arial,sans-serif,16'\n"
               "set title {} noenhanced font ',19' offset 0,-0.4\n"
               "set xlabel {} noenhanced offset 0,0.3\n"
               "set ylabel {} noenhanced\n"
               "set key outside below center horizontal Left reverse noenhanced font ',15'\n"
               "set key maxcols {} width -1 samplen 3 height 0.8\n"
               "set border 3 linecolor '#444444'\n"
               "set tics nomirror textcolor '#000000'\n"
               "set grid xtics ytics linetype 1 linewidth 0.8 linecolor '#DDDDDD'\n",
               width_px, height, literal_lines(figure.title, 80), literal(figure.x_label), literal(figure.y_label),
               columns) +
           x.settings("x") + (figure.whole_x ? "set xtics 1\nunset mxtics\n" : "") + y.settings("y") + data + "plot " +
           plots + "\n";
}

}  // namespace

std::string draw_svg(const Figure& figure, const std::string& shown_as) {
    return run_gnuplot(script(figure), shown_as);
}

void write_drawing(AtomicPath& target, const std::string& svg) {
    const std::string file = target.target().string();
    write_text(target, rendered(svg, picture_of(file, "figure"), file));
}

void write_figure(AtomicPath& target, const Figure& figure) {
    write_drawing(target, draw_svg(figure, target.target().string()));
}

void write_svg(const std::filesystem::path& path, const Figure& figure) {
    std::optional<AtomicPath> target;
    try {
        target.emplace(path);
    } catch (const InputError& error) {
        throw RunError(error.what());
    }
    write_text(*target, draw_svg(figure, target->target().string()));
}

}  // namespace ringlock::report
