#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "analysis/report/map.hpp"
#include "analysis/report/plot.hpp"
#include "analysis/report/render.hpp"
#include "engine/core/error.hpp"

namespace report_map_test {
namespace {

using namespace ringlock;
using report::MapPanel;
using report::PictureForm;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

report::Map two_panels() {
    report::Map map{.title = "a 'map' of \"noise\"",
                    .x_label = "time [s]",
                    .y_label = "tau [s]",
                    .colour_label = "oadev [deg/h]",
                    .rows = {"0.1", "0.2"},
                    .panels = {}};
    map.panels.push_back({.title = "first",
                          .cells = {{.begin = 0.0, .end = 5.0, .row = 0, .value = 1.0},
                                    {.begin = 5.0, .end = 10.0, .row = 1, .value = 20.0},
                                    {.begin = 0.0, .end = 5.0, .row = 1, .value = 0.0}}});
    map.panels.push_back({.title = "second", .cells = {}});
    return map;
}

std::size_t count(const std::string& text, const std::string& what) {
    std::size_t n = 0;
    for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += what.size()) ++n;
    return n;
}

/// What the map of two values says, without its cells.
std::string scale_of(double lowest, double highest) {
    report::Map map = two_panels();
    map.rows = {"row"};
    map.panels = {{.title = "",
                   .cells = {{.begin = 0.0, .end = 5.0, .row = 0, .value = lowest},
                             {.begin = 5.0, .end = 10.0, .row = 0, .value = highest}}}};
    return report::draw_map(map, "map.svg");
}

// Labels of the colour scale are as those of the other axes, few even where the values go over many decades.
TEST(ReportMap, LabelsOfColoursAreReadable) {
    EXPECT_THAT(scale_of(300.0, 6500.0), AllOf(HasSubstr(">500<"), HasSubstr(">1000<"), HasSubstr(">5000<")));
    EXPECT_THAT(scale_of(300.0, 6500.0), Not(HasSubstr("e+")));
    EXPECT_THAT(scale_of(2e5, 6e6), AllOf(HasSubstr("2×10"), HasSubstr("5×10"), Not(HasSubstr("e+"))));
    EXPECT_THAT(scale_of(0.0013, 0.0017), AllOf(HasSubstr(">0.0013<"), HasSubstr(">0.0017<")));
    EXPECT_THAT(scale_of(0.003, 40.0), AllOf(HasSubstr(">0.01<"), HasSubstr(">10<"), Not(HasSubstr(">0.02<"))));
    EXPECT_EQ(count(scale_of(1e-12, 1e12), "1×10"), 6U) << "every third of 25 decades, three of them in plain notation";
}

// Every cell with a value is drawn in its colour; the ends of the scale have those of the palette.
TEST(ReportMap, CellsHaveTheColoursOfTheirValues) {
    const std::string svg = report::draw_map(two_panels(), "map.svg");
    EXPECT_THAT(svg, AllOf(HasSubstr("oadev [deg/h]"), HasSubstr(">first<"), HasSubstr("second (nothing to show)")));
    EXPECT_THAT(svg, HasSubstr("</svg>"));
    EXPECT_EQ(svg, report::draw_map(two_panels(), "other.svg"));
    report::Map one = two_panels();
    one.panels.pop_back();
    const std::string dark = "rgb( 68,   1,  84)";
    const std::string light = "rgb(253, 231,  37)";
    const std::string drawn = report::draw_map(one, "map.svg");
    one.panels.front().cells.push_back({.begin = 5.0, .end = 10.0, .row = 0, .value = 1.0});
    one.panels.front().cells.push_back({.begin = 0.0, .end = 5.0, .row = 1, .value = 20.0});
    const std::string more = report::draw_map(one, "map.svg");
    EXPECT_EQ(count(more, dark), count(drawn, dark) + 1);
    EXPECT_EQ(count(more, light), count(drawn, light) + 1);
}

TEST(ReportMap, MapsWithoutAnythingToShowAreDrawn) {
    report::Map map = two_panels();
    map.panels.front().cells = {
        {.begin = 0.0, .end = 1.0, .row = 0, .value = std::numeric_limits<double>::quiet_NaN()}};
    EXPECT_THAT(report::draw_map(map, "map.svg"), HasSubstr("first (nothing to show)"));
    map.panels.clear();
    map.rows.clear();
    EXPECT_THAT(report::draw_map(map, "map.svg"), HasSubstr("</svg>"));
}

TEST(ReportRender, TheEndingOfTheNameSaysTheForm) {
    EXPECT_EQ(report::picture_of("a.svg", "--plot"), PictureForm::svg);
    EXPECT_EQ(report::picture_of("A.SVG", "--plot"), PictureForm::svg);
    for (const char* name : {"a.gif", "a", ".png", "a.svg.gz", ""}) {
        try {
            report::picture_of(name, "--plot");
            ADD_FAILURE() << name;
        } catch (const InputError& error) {
            EXPECT_THAT(error.what(), AllOf(StartsWith("--plot"), HasSubstr("must end in .svg, .png or .pdf")));
        }
    }
    if (!report::renders_pictures()) GTEST_SKIP() << "librsvg is missing: pictures are SVG only";
    EXPECT_EQ(report::picture_of("a.png", "--plot"), PictureForm::png);
    EXPECT_EQ(report::picture_of("b/a.Pdf", "--plot"), PictureForm::pdf);
}

TEST(ReportRender, PicturesHaveTwiceTheSizeOfTheDrawing) {
    const std::string svg =
        "<svg xmlns='http://www.w3.org/2000/svg' width='90' height='60'><rect width='45' height='60' "
        "fill='#0072B2'/></svg>";
    EXPECT_EQ(report::rendered(svg, PictureForm::svg, "a.svg"), svg);
    if (!report::renders_pictures()) GTEST_SKIP() << "librsvg is missing: pictures are SVG only";
    const std::string png = report::rendered(svg, PictureForm::png, "a.png");
    ASSERT_THAT(png, StartsWith("\x89PNG\r\n\x1a\n"));
    EXPECT_EQ(static_cast<unsigned char>(png[19]), 180);  // width and height, big-endian, at 16 and 20
    EXPECT_EQ(static_cast<unsigned char>(png[23]), 120);
    const std::string pdf = report::rendered(svg, PictureForm::pdf, "a.pdf");
    EXPECT_THAT(pdf, AllOf(StartsWith("%PDF-"), HasSubstr("/MediaBox [ 0 0 67.5 45 ]")));
    EXPECT_EQ(pdf, report::rendered(svg, PictureForm::pdf, "a.pdf"));
    EXPECT_THROW(report::rendered("<svg", PictureForm::png, "a.png"), RunError);
    EXPECT_THROW(report::rendered("", PictureForm::pdf, "a.pdf"), RunError);
}

// A curve without a label has no entry in the legend, and one with a colour of its own has that of its partner.
TEST(CurvesOfAPlot, ThatBelongTogetherShareAColourAndAnEntry) {
    report::Figure figure{.title = "t", .x_label = "x", .y_label = "y"};
    figure.curves.push_back({.label = "points", .x = {1, 2}, .y = {1, 2}, .colour = 3});
    figure.curves.push_back({.label = "", .x = {1, 2}, .y = {1, 2}, .style = report::Curve::Style::line, .colour = 3});
    const std::string svg = report::draw_svg(figure, "f.svg");
    EXPECT_THAT(svg, Not(HasSubstr("nothing to show")));
    EXPECT_THAT(svg, HasSubstr(">points<"));
    EXPECT_THAT(svg, HasSubstr("rgb(204, 121, 167)"));  // the fourth of the palette
    EXPECT_THAT(svg, Not(HasSubstr("rgb(  0, 114, 178)")));
}

}  // namespace
}  // namespace report_map_test
