#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/atomic_path.hpp"

namespace ringlock::report {

/// One curve of a figure. Labels and titles are UTF-8 and are shown as they are.
struct Curve {
    /// points: markers with error bars; line, dashed: straight lines between the points (dashed: drawn above all
    /// others, for theory); band: what lies between lo and hi, filled, below all others. Bands have the colours of the
    /// first curves.
    enum class Style { points, line, dashed, band };

    std::string label;
    std::vector<double> x = {};
    std::vector<double> y = {};
    std::vector<double> lo =
        {};  ///< lower ends of the error bars in units of y; empty: no bars. NaN: none on that side
    std::vector<double> hi = {};  ///< upper ends, likewise
    Style style = Style::points;
    /// Number of the colour; without it curves of a kind have one after the other. A line with a colour of its own is
    /// thin, for it belongs to the curve of that colour.
    std::optional<std::size_t> colour = {};

    /// A curve without a label has no entry in the legend.
    bool in_legend() const { return !label.empty(); }
};

struct Figure {
    std::string title;
    std::string x_label;
    std::string y_label;
    bool log_x = false;
    bool log_y = false;
    std::vector<Curve> curves = {};
    bool whole_x = false;  ///< ticks at whole numbers only
};

/// Draws a figure with gnuplot as SVG 900 wide and 620 high (higher when the legend is long).
///
/// Points that an axis cannot show (not finite, or not above zero on a logarithmic one) are left out; a curve that has
/// no other keeps its place in the legend, which says so. Bars reaching out of the axes end at them. The same figure
/// always gives the same bytes under the same gnuplot. `shown_as` names it in errors.
///
/// Throws std::invalid_argument when the vectors of a curve differ in length, and RunError when gnuplot is missing or
/// fails.
std::string draw_svg(const Figure& figure, const std::string& shown_as);

/// Writes an SVG that is drawn into a file that is claimed, as SVG, PNG or PDF by the ending of its name, complete or
/// not at all. Throws RunError, too, when the file cannot be written.
void write_drawing(AtomicPath& target, const std::string& svg);
/// Draws a figure and writes it so.
void write_figure(AtomicPath& target, const Figure& figure);
/// Draws it as SVG, the file claimed now.
void write_svg(const std::filesystem::path& path, const Figure& figure);

}  // namespace ringlock::report
