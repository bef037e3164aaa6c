#pragma once
#include <string>
#include <vector>

namespace ringlock::report {

/// One panel of a map: rectangles over time, in rows.
struct MapPanel {
    struct Cell {
        double begin = 0.0;  ///< along x
        double end = 0.0;
        std::size_t row = 0;
        double value = 0.0;  ///< > 0, or nothing is drawn
    };
    std::string title;
    std::vector<Cell> cells;
};

/// Panels one above the other with one scale of colours, which is logarithmic. Text is UTF-8 and shown as it is.
struct Map {
    std::string title;
    std::string x_label;
    std::string y_label;
    std::string colour_label;
    std::vector<std::string> rows;  ///< labels, from the lowest row on
    std::vector<MapPanel> panels;
};

/// Draws it with gnuplot as SVG, 900 wide. The scale of colours goes from dark to light as the values rise, so that it
/// can be read in grey, too. The same map always gives the same bytes under the same gnuplot. Throws RunError as
/// draw_svg() does.
std::string draw_map(const Map& map, const std::string& shown_as);

}  // namespace ringlock::report
