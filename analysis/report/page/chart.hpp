#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "analysis/report/page/ticks.hpp"
#include "analysis/report/plot.hpp"

namespace ringlock::report {

/// How a curve of a chart is drawn. Colours are classes of the style sheet, which has a palette for light and one for
/// dark screens; markers and dashes distinguish the curves without colours.
struct Look {
    static constexpr int colours = 7;   ///< classes c0 to c6
    static constexpr int neutral = -1;  ///< the colour of the text, for theory: class ct
    int colour = 0;
    int marker = 0;  ///< 0 to 6: circle, square, triangle, diamond, triangle on its tip, cross, plus
    int dash = 0;    ///< of lines: 0 solid, then patterns 1 to 3
};

/// A figure with its curves' looks and the ranges of its axes, which the SVG and the interactive figure share.
class Chart {
   public:
    /// Throws std::invalid_argument where the vectors of a curve differ in length.
    explicit Chart(Figure figure);

    const Figure& figure() const { return figure_; }
    const std::vector<Look>& looks() const { return looks_; }
    const AxisRange& x_range() const { return x_range_; }
    const AxisRange& y_range() const { return y_range_; }

    /// Whether the axes can show the point.
    bool shows(double x, double y) const;
    /// Points of the curve that the axes can show.
    std::size_t shown_points(const Curve& curve) const;

    /// The figure in words: axes with their ranges, curves with their first and last points.
    std::string description() const;

   private:
    Figure figure_;
    std::vector<Look> looks_;
    AxisRange x_range_;
    AxisRange y_range_;
};

/// The chart as an <svg> element with role img, title and desc. Colours and fonts come from the style sheet of the
/// page. Points that an axis cannot show are left out; bars end at the axes. The same chart gives the same bytes.
///
/// \param id  of the page's elements that belong to the chart, such as "figure-2"
std::string chart_svg(const Chart& chart, const std::string& id);

/// The legend as an HTML list. A curve without points that can be shown stays in it, and the entry says so.
std::string chart_legend(const Chart& chart);

/// The values of all curves as an HTML table.
std::string chart_table(const Chart& chart);

/// What the page's script draws the interactive figure from.
nlohmann::ordered_json chart_json(const Chart& chart, const std::string& id);

}  // namespace ringlock::report
