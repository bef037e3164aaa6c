#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>

#include "analysis/report/plot.hpp"
#include "engine/core/error.hpp"

namespace report_plot_test {
namespace {

namespace fs = std::filesystem;
using ringlock::report::Curve;
using ringlock::report::Figure;
using ringlock::report::write_svg;
using testing::HasSubstr;
using testing::Not;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

/// Sets a variable of the environment for its scope.
class Environment {
   public:
    Environment(const char* name, const std::string& value) : name_(name), old_(std::getenv(name)) {
        ::setenv(name, value.c_str(), 1);
    }
    ~Environment() { ::setenv(name_, old_.c_str(), 1); }

   private:
    const char* name_;
    std::string old_;
};

class ReportPlot : public testing::Test {
   protected:
    void SetUp() override {
        std::string pattern = (fs::temp_directory_path() / "ringlock-plot-XXXXXX").string();
        ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
        directory_ = pattern;
    }
    void TearDown() override { fs::remove_all(directory_); }

    static bool have_gnuplot() { return std::system("command -v gnuplot >/dev/null 2>&1") == 0; }

    std::string draw(const Figure& figure, const std::string& name = "figure.svg") const {
        write_svg(directory_ / name, figure);
        return read(directory_ / name);
    }
    static std::string read(const fs::path& path) {
        std::ifstream file(path);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    std::size_t files() const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(directory_), fs::directory_iterator()));
    }
    /// Puts a script in the place of gnuplot; keep what it returns.
    Environment fake_gnuplot(const std::string& script) const {
        const fs::path bin = directory_ / "bin";
        fs::create_directory(bin);
        std::ofstream(bin / "gnuplot") << "#!/bin/sh\n" << script << "\n";
        fs::permissions(bin / "gnuplot", fs::perms::owner_all);
        return {"PATH", bin.string() + ":/usr/bin:/bin"};
    }

    fs::path directory_;
};

std::string message_of(const fs::path& path, const Figure& figure) {
    try {
        write_svg(path, figure);
    } catch (const ringlock::RunError& error) {
        return error.what();
    }
    return "no error";
}

std::size_t count(const std::string& text, const std::string& part) {
    std::size_t n = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
    return n;
}

Figure allan_figure() {
    Figure figure{"Allan deviation", "tau [s]", "deviation [deg/h]", true, true, {}};
    Curve points{.label = "noise_injected+compensated"};
    Curve theory{.label = "theory 0.135/sqrt(tau)", .style = Curve::Style::dashed};
    for (const double tau : {1.0, 3.0, 10.0, 30.0, 100.0}) {
        const double y = 0.135 / std::sqrt(tau);
        points.x.push_back(tau);
        points.y.push_back(y);
        points.lo.push_back(0.8 * y);
        points.hi.push_back(1.3 * y);
        theory.x.push_back(tau);
        theory.y.push_back(y);
    }
    figure.curves = {points, theory};
    return figure;
}

#define NEEDS_GNUPLOT() \
    if (!have_gnuplot()) GTEST_SKIP() << "gnuplot is not installed (Debian package gnuplot-nox)"

TEST_F(ReportPlot, ShowsTitleAxesAndLegendAsWritten) {
    NEEDS_GNUPLOT();
    const std::string svg = draw(allan_figure());
    EXPECT_THAT(svg, testing::StartsWith("<?xml"));
    EXPECT_THAT(svg, HasSubstr("width=\"900\" height=\"620\""));
    EXPECT_THAT(svg, HasSubstr("</svg>"));
    EXPECT_EQ(count(svg, "<g "), count(svg, "</g>"));
    EXPECT_EQ(count(svg, "<text>"), count(svg, "</text>"));
    for (const char* text : {"Allan deviation", "tau [s]", "deviation [deg/h]", "noise_injected+compensated",
                             "theory 0.135/sqrt(tau)", "stroke-dasharray"}) {
        EXPECT_THAT(svg, HasSubstr(text));
    }
    EXPECT_EQ(files(), 1u);
}

TEST_F(ReportPlot, SameFigureGivesSameBytesWhereverItIs) {
    NEEDS_GNUPLOT();
    const std::string svg = draw(allan_figure(), "a.svg");
    EXPECT_EQ(svg, draw(allan_figure(), "b'c d.svg"));
    EXPECT_THAT(svg, Not(HasSubstr(directory_.string())));
}

TEST_F(ReportPlot, ReplacesAnOlderFigure) {
    NEEDS_GNUPLOT();
    std::ofstream(directory_ / "figure.svg") << "old";
    EXPECT_THAT(draw(allan_figure()), Not(HasSubstr("old")));
}

TEST_F(ReportPlot, TextIsNeitherMarkupNorCode) {
    NEEDS_GNUPLOT();
    Figure figure = allan_figure();
    figure.title = "it's a_b^{2} & <x> \"y\" `touch broken` $(touch broken)";
    figure.y_label = "Ω in °/h\n";
    figure.curves[0].label = "&<b>';system('touch broken');'";
    const std::string svg = draw(figure);
    EXPECT_THAT(svg, HasSubstr("it's a_b^{2} &amp; &lt;x"));
    EXPECT_THAT(svg, HasSubstr("`touch broken` $(touch broken)"));
    EXPECT_THAT(svg, HasSubstr("Ω in °/h"));
    EXPECT_THAT(svg, HasSubstr("';system('touch broken');'"));
    EXPECT_FALSE(fs::exists("broken"));
}

TEST_F(ReportPlot, LeavesOutWhatAnAxisCannotShow) {
    NEEDS_GNUPLOT();
    Figure clean{"", "", "", true, true, {{.label = "a", .x = {1.0, 10.0}, .y = {1.0, 2.0}}}};
    Figure dirty = clean;
    dirty.curves[0].x = {0.0, 1.0, -1.0, 3.0, 4.0, 5.0, 10.0};
    dirty.curves[0].y = {1.0, 1.0, 1.0, 0.0, nan, inf, 2.0};
    EXPECT_EQ(draw(clean), draw(dirty));
}

TEST_F(ReportPlot, BarsEndAtTheAxes) {
    NEEDS_GNUPLOT();
    Figure figure{"",   "",
                  "",   true,
                  true, {{.label = "a", .x = {1, 10, 20}, .y = {1, 2, 3}, .lo = {0, -1, nan}, .hi = {2, inf, nan}}}};
    const std::string svg = draw(figure);
    EXPECT_THAT(svg, Not(HasSubstr("nan")));
    EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST_F(ReportPlot, FillsABandBelowTheCurves) {
    NEEDS_GNUPLOT();
    Figure figure = allan_figure();
    Curve band{.label = "simulations", .x = {1.0, 10.0, 100.0}, .y = {0.05, 0.02, 0.01}, .lo = {0.05, 0.02, 0.01}};
    band.hi = {0.2, 0.1, inf};
    band.style = Curve::Style::band;
    figure.curves.push_back(band);
    const std::string svg = draw(figure);
    const auto fill = svg.find("fill-opacity");
    ASSERT_NE(fill, std::string::npos);
    EXPECT_LT(fill, svg.find("stroke-dasharray"));
    EXPECT_THAT(svg, HasSubstr("simulations"));
    EXPECT_THAT(svg, Not(HasSubstr("inf")));
    figure.curves.back().lo.clear();
    figure.curves.back().hi.clear();
    EXPECT_THROW(draw(figure), std::invalid_argument);
}

TEST_F(ReportPlot, CountsHaveTicksAtWholeNumbers) {
    NEEDS_GNUPLOT();
    Figure figure{"", "", "", false, false, {{.label = "a", .x = {0.0, 1.0, 2.0}, .y = {1.0, 2.0, 3.0}}}};
    EXPECT_THAT(draw(figure), HasSubstr(">0.5<"));
    figure.whole_x = true;
    EXPECT_THAT(draw(figure), Not(HasSubstr(">0.5<")));
}

TEST_F(ReportPlot, ACurveWithoutPointsSaysSoInTheLegend) {
    NEEDS_GNUPLOT();
    Figure figure = allan_figure();
    figure.curves.push_back({.label = "locked", .x = {1.0, 2.0}, .y = {0.0, 0.0}});
    EXPECT_THAT(draw(figure), HasSubstr("locked (nothing to show)"));
    figure.curves = {figure.curves.back()};
    EXPECT_THAT(draw(figure), HasSubstr("locked (nothing to show)"));
    figure.curves.clear();
    EXPECT_THAT(draw(figure), HasSubstr("tau [s]"));
}

TEST_F(ReportPlot, DrawsExtremeRanges) {
    NEEDS_GNUPLOT();
    for (const bool log : {false, true}) {
        for (const double y : {1e-300, 1e-9, 1.0, 123456.789, 1e300}) {
            Figure figure{"", "", "", log, log, {{.label = "a", .x = {y}, .y = {y}}}};
            EXPECT_NO_THROW(draw(figure)) << y;
        }
        Figure wide{"", "", "", log, log, {{.label = "a", .x = {1e-300, 1e300}, .y = {1e-300, 1e300}}}};
        EXPECT_NO_THROW(draw(wide));
    }
}

TEST_F(ReportPlot, RefusesCurvesOfUnequalLength) {
    Figure figure = allan_figure();
    figure.curves[0].y.pop_back();
    EXPECT_THROW(draw(figure), std::invalid_argument);
    figure = allan_figure();
    figure.curves[0].hi.clear();
    EXPECT_THROW(draw(figure), std::invalid_argument);
}

TEST_F(ReportPlot, NamesThePackageOfAMissingGnuplot) {
    const Environment path("PATH", directory_.string());
    EXPECT_THAT(message_of(directory_ / "figure.svg", allan_figure()), HasSubstr("gnuplot-nox"));
    EXPECT_EQ(files(), 0u);
}

TEST_F(ReportPlot, PassesOnWhatGnuplotSaid) {
    const Environment path = fake_gnuplot("echo 'line 7: no such thing' >&2; exit 1");
    EXPECT_THAT(message_of(directory_ / "figure.svg", allan_figure()), HasSubstr("line 7: no such thing"));
    EXPECT_EQ(files(), 1u);
}

TEST_F(ReportPlot, SurvivesAGnuplotThatDoesNotRead) {
    Figure figure = allan_figure();
    figure.curves[1].x.assign(100000, 1.0);
    figure.curves[1].y.assign(100000, 1.0);
    const Environment path = fake_gnuplot("exec <&-; kill -9 $$");
    EXPECT_THAT(message_of(directory_ / "figure.svg", figure), HasSubstr("signal 9"));
}

TEST_F(ReportPlot, NoticesAnIncompleteFigureAndKeepsTheOlder) {
    std::ofstream(directory_ / "figure.svg") << "old";
    const Environment path = fake_gnuplot("echo '<svg>'");
    EXPECT_THAT(message_of(directory_ / "figure.svg", allan_figure()), HasSubstr("incomplete"));
    EXPECT_EQ(read(directory_ / "figure.svg"), "old");
    EXPECT_EQ(files(), 2u);
}

TEST_F(ReportPlot, NamesAFileThatCannotBeWritten) {
    const fs::path path = directory_ / "none" / "figure.svg";
    EXPECT_THAT(message_of(path, allan_figure()), HasSubstr(path.string()));
}

}  // namespace
}  // namespace report_plot_test
