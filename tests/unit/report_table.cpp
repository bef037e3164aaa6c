#include <gtest/gtest.h>

#include <stdexcept>

#include "analysis/report/table.hpp"

namespace report_table_test {
namespace {

using ringlock::report::Align;
using ringlock::report::Table;

TEST(ReportTable, AlignsColumnsToTheirWidestCell) {
    Table table({{"arm"}, {"N [deg/sqrt(h)]", Align::right}, {"noise"}});
    table.add_row({"ideal", "1e-6", "white phase"});
    table.add_row({"noise_injected", "0.00225", ""});
    EXPECT_EQ(table.text(),
              "arm             N [deg/sqrt(h)]  noise\n"
              "ideal                      1e-6  white phase\n"
              "noise_injected          0.00225\n");
}

TEST(ReportTable, IndentsEveryLine) {
    Table table({{"a"}, {"b", Align::right}});
    table.add_row({"x", "10"});
    EXPECT_EQ(table.text(2), "  a   b\n  x  10\n");
}

TEST(ReportTable, CountsCodePointsRatherThanBytes) {
    Table table({{"v", Align::right}, {"unit"}});
    table.add_row({"1 ± 2", "°/h"});
    table.add_row({"1000000", "s"});
    EXPECT_EQ(table.text(), "      v  unit\n  1 ± 2  °/h\n1000000  s\n");
}

TEST(ReportTable, LeavesOutEmptyHeadersAndFillsShortRows) {
    Table table({{""}, {"", Align::right}, {""}});
    table.add_row({"one"});
    table.add_row({"a", "2", "c"});
    EXPECT_EQ(table.text(), "one\na    2  c\n");
}

TEST(ReportTable, WithoutRowsHasOnlyHeaders) { EXPECT_EQ(Table({{"a"}, {"b"}}).text(), "a  b\n"); }

TEST(ReportTable, RefusesCellsThatDoNotFit) {
    Table table({{"a"}});
    EXPECT_THROW(table.add_row({"1", "2"}), std::invalid_argument);
    EXPECT_THROW(table.add_row({"1\n2"}), std::invalid_argument);
    EXPECT_THROW(Table({{"a\n"}}), std::invalid_argument);
}

}  // namespace
}  // namespace report_table_test
