// Report pages: escaping, ticks, drawings and hashes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "analysis/report/page/assets.hpp"
#include "analysis/report/page/chart.hpp"
#include "analysis/report/page/html.hpp"
#include "analysis/report/page/page.hpp"
#include "analysis/report/page/ticks.hpp"
#include "analysis/report/passage.hpp"

namespace report_page_test {
namespace {

using namespace ringlock::report;
using testing::AllOf;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::Ge;
using testing::HasSubstr;
using testing::Le;
using testing::Not;
using testing::Pointwise;

constexpr const char* hostile = "</title></script><img src=x onerror=\"alert('1')\">&amp;\x1b[31m\u202e";

TEST(ReportHtml, EscapesMarkupAndControls) {
    EXPECT_EQ(html_escaped("a < b & \"c\" > 'd'"), "a &lt; b &amp; &quot;c&quot; &gt; &#39;d&#39;");
    EXPECT_EQ(html_escaped("red\x1b[31m\nnew line"), "red\\x1b[31m\\x0anew line");
    EXPECT_EQ(html_escaped("\u202eabc"), "\\u202eabc");
    EXPECT_EQ(html_escaped("\xff"), "\\xff");
    EXPECT_EQ(html_escaped_lines("a\n\t<b>\x07"), "a\n\t&lt;b&gt;\\x07");
}

TEST(ReportTicks, LinearTicksAreRoundNumbersWithinTheRange) {
    EXPECT_THAT(linear_ticks({0.0, 10.0}, 6).major, Pointwise(DoubleNear(1e-12), {0.0, 2.0, 4.0, 6.0, 8.0, 10.0}));
    EXPECT_THAT(linear_ticks({-0.13, 0.08}, 5).major, Pointwise(DoubleNear(1e-12), {-0.1, -0.05, 0.0, 0.05}));
    EXPECT_THAT(linear_ticks({0.9, 4.1}, 9, true).major, ElementsAre(1.0, 2.0, 3.0, 4.0));
}

TEST(ReportTicks, LogarithmicTicksArePowersOfTen) {
    EXPECT_THAT(log_ticks({0.5, 2000.0}, 8).major, Pointwise(DoubleNear(1e-9), {1.0, 10.0, 100.0, 1000.0}));
    const std::vector<double> minor = log_ticks({0.5, 200.0}, 8).minor;
    EXPECT_THAT(minor, testing::Contains(DoubleNear(0.5, 1e-12)));
    EXPECT_THAT(minor, Not(testing::Contains(DoubleNear(10.0, 1e-9))));
}

TEST(ReportTicks, ShortLogarithmicRangesHaveTicksToo) {
    EXPECT_THAT(log_ticks({1.5, 30.0}, 8).major, Pointwise(DoubleNear(1e-12), {2.0, 5.0, 10.0, 20.0}));
    EXPECT_THAT(log_ticks({2.1, 2.9}, 8).major.size(), Ge(4U));
    // Of many decades every n-th is left.
    EXPECT_THAT(log_ticks({1e-20, 1e20}, 8).major.size(), AllOf(Ge(4U), Le(9U)));
}

TEST(ReportTicks, RangesShowAllValuesThatTheAxisCanShow) {
    const AxisRange range = axis_range({1e-3, NAN, -5.0, 0.0, 100.0}, true);
    EXPECT_LT(range.lo, 1e-3);
    EXPECT_GT(range.lo, 1e-4);
    EXPECT_GT(range.hi, 100.0);
    for (const bool logarithmic : {false, true}) {
        for (const std::vector<double>& values : {std::vector<double>{}, {7.0}, {NAN}, {1e308}, {5e-324}}) {
            const AxisRange any = axis_range(values, logarithmic);
            EXPECT_LT(any.lo, any.hi);
            EXPECT_TRUE(std::isfinite(any.lo) && std::isfinite(any.hi));
        }
    }
}

TEST(ReportTicks, LabelsAreShort) {
    EXPECT_EQ(tick_label(0.0), "0");
    EXPECT_EQ(tick_label(0.002), "0.002");
    EXPECT_EQ(tick_label(1e-5), "10⁻⁵");
    EXPECT_EQ(tick_label(2e-5), "2·10⁻⁵");
    EXPECT_EQ(tick_label(-1e6), "-10⁶");
    EXPECT_EQ(tick_label(0.1 + 0.2), "0.3");
}

Figure figure() {
    Figure figure{.title = hostile, .x_label = "tau [s]", .y_label = hostile, .log_x = true, .log_y = true};
    figure.curves.push_back({.label = hostile,
                             .x = {1.0, 10.0, 100.0},
                             .y = {1.0, 0.0, 0.01},
                             .lo = {0.5, 0.0, -1.0},
                             .hi = {2.0, 1.0, 0.1}});
    figure.curves.push_back({.label = "line", .x = {1.0, 100.0}, .y = {2.0, 0.02}, .style = Curve::Style::line});
    figure.curves.push_back({.label = "theory", .x = {1.0, 100.0}, .y = {1.0, 0.1}, .style = Curve::Style::dashed});
    figure.curves.push_back({.label = "none", .x = {1.0}, .y = {NAN}});
    return figure;
}

TEST(ReportChart, DrawsEqualFiguresInEqualBytes) {
    EXPECT_EQ(chart_svg(Chart(figure()), "figure-1"), chart_svg(Chart(figure()), "figure-1"));
    EXPECT_EQ(chart_json(Chart(figure()), "f").dump(), chart_json(Chart(figure()), "f").dump());
}

TEST(ReportChart, IsAnImageWithTitleAndDescription) {
    const std::string svg = chart_svg(Chart(figure()), "figure-1");
    EXPECT_THAT(svg, AllOf(HasSubstr("role=\"img\""), HasSubstr("<title id=\"figure-1-title\">"),
                           HasSubstr("<desc id=\"figure-1-desc\">"), HasSubstr(">0.01</text>")));
    // Neither styles in attributes nor numbers that are none.
    EXPECT_THAT(svg, AllOf(Not(HasSubstr("style=")), Not(HasSubstr("nan")), Not(HasSubstr("inf"))));
}

TEST(ReportChart, LeavesOutPointsThatAnAxisCannotShow) {
    const Chart chart(figure());
    EXPECT_EQ(chart.shown_points(chart.figure().curves[0]), 2U);
    EXPECT_THAT(chart_legend(chart), HasSubstr("none (no points)"));
    EXPECT_EQ(chart_json(chart, "f")["rows"].size(), 2U);
    // A bar that a logarithmic axis cannot show ends at the axis.
    EXPECT_GT(chart_json(chart, "f")["rows"][1][1][0].get<double>(), 0.0);
}

TEST(ReportChart, CurvesDifferWithoutColours) {
    Figure many{.title = "t", .x_label = "x", .y_label = "y"};
    for (int i = 0; i < 7; ++i) many.curves.push_back({.label = std::to_string(i), .x = {1.0 * i}, .y = {1.0}});
    const Chart chart(many);
    for (std::size_t i = 0; i < 7; ++i) {
        for (std::size_t j = 0; j < i; ++j) EXPECT_NE(chart.looks()[i].marker, chart.looks()[j].marker);
    }
}

TEST(ReportChart, RefusesCurvesOfUnequalLengths) {
    Figure bad{.title = "t", .x_label = "x", .y_label = "y"};
    bad.curves.push_back({.label = "c", .x = {1.0, 2.0}, .y = {1.0}});
    EXPECT_THROW(Chart{bad}, std::invalid_argument);
}

TEST(ReportChart, AVerticalLineKeepsItsPoints) {
    Figure lines{.title = "t", .x_label = "x", .y_label = "y"};
    lines.curves.push_back({.label = "v", .x = {3.0, 3.0}, .y = {0.0, 1.0}, .style = Curve::Style::line});
    lines.curves.push_back({.label = "p", .x = {3.0}, .y = {0.5}});
    const auto rows = chart_json(Chart(lines), "f")["rows"];
    ASSERT_EQ(rows.size(), 2U);
    EXPECT_EQ(rows[0][1][1].get<double>(), 0.0);
    EXPECT_EQ(rows[1][1][1].get<double>(), 1.0);
    EXPECT_TRUE(rows[1][2].is_null());
}

TEST(ReportPage, HashesAreThoseOfThePolicy) {
    // SHA-256 of nothing, as FIPS 180 and RFC 4648 give it.
    EXPECT_EQ(csp_hash("e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"),
              "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='");
}

std::string page() {
    Page page(hostile, hostile);
    Table table({{hostile}, {"n", Align::right}});
    table.add_row({"<b>&", "1"});
    page.answer("Answer", {hostile});
    page.heading(hostile);
    page.paragraph(hostile);
    page.list({hostile});
    page.table(table, hostile);
    page.chart(figure(), hostile);
    page.facts({{hostile, hostile}}, hostile);
    page.code("rm 'a b'\n", "Command");
    page.folded_code(hostile, hostile);
    return page.html();
}

/// The page without the parts that are the same in all pages.
std::string contents(std::string html) {
    for (const std::string_view part : {assets::style, assets::script}) {
        if (const auto at = html.find(part); !part.empty() && at != std::string::npos) html.erase(at, part.size());
    }
    return html;
}

TEST(ReportPage, NothingOfATextIsMarkup) {
    const std::string html = contents(page());
    EXPECT_THAT(html, AllOf(Not(HasSubstr("<img")), Not(HasSubstr("onerror=\"")), Not(HasSubstr("\x1b")),
                            Not(HasSubstr("\u202e")), HasSubstr("<td>&lt;b&gt;&amp;</td>")));
    // The only elements that end a script are the page's own: the data and the script.
    std::size_t ends = 0;
    for (std::size_t at = 0; (at = html.find("</script", at)) != std::string::npos; ++at) ++ends;
    EXPECT_EQ(ends, assets::script.empty() ? 0U : 2U);
}

TEST(ReportPage, HoldsAPolicyThatItsPartsObey) {
    const std::string html = contents(page());
    EXPECT_THAT(html, AllOf(HasSubstr("default-src 'none'"), HasSubstr("style-src 'sha256-")));
    EXPECT_THAT(html, AllOf(Not(HasSubstr(" style=")), Not(HasSubstr("unsafe-")), Not(HasSubstr("http://")),
                            Not(HasSubstr("https://"))));
    EXPECT_EQ(html.find("script-src") != std::string::npos, !assets::script.empty());
    EXPECT_EQ(page_script() != "none", !assets::script.empty());
}

TEST(ReportPage, RegionsHaveNamesOfTheirOwn) {
    Page page("t", "k");
    page.code("a", "Command");
    page.code("b", "Command");
    EXPECT_THAT(page.html(), AllOf(HasSubstr("aria-label=\"Command\""), HasSubstr("aria-label=\"Command (2)\"")));
}

TEST(ReportPage, EqualContentsGiveEqualBytes) { EXPECT_EQ(page(), page()); }

TEST(ReportPassage, IsTextWithAnEmptyLineBetweenTwo) {
    Table table({{"a"}, {"b", Align::right}});
    table.add_row({"x", "1"});
    const std::vector<Passage> passages{{.heading = "Head", .before = "before\n", .table = table}, {.notes = "note\n"}};
    EXPECT_EQ(text_of(passages), "Head\nbefore\na  b\nx  1\n\nnote\n");
    EXPECT_THAT(lines_of("one\n\ntwo"), ElementsAre("one", "two"));
}

}  // namespace
}  // namespace report_page_test
