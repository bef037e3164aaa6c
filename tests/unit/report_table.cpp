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

TEST(ReportTable, ContinuesBelowWhatAWindowDoesNotHold) {
    const std::string wide(45, 'w');
    Table table({{"arm"}, {"one", Align::right}, {"two"}, {"three", Align::right}, {"four"}});
    table.add_row({"ideal", wide, wide, "3", "4"});
    table.add_row({"other", "1", "2", "33", ""});
    // 5 + 2 + 45 + 2 + 45 = 99 columns; the next one would end beyond 100.
    const std::string blanks(44, ' ');
    EXPECT_EQ(table.text(), "arm    " + std::string(42, ' ') + "one  two\n" +  //
                                "ideal  " + wide + "  " + wide + "\n" +        //
                                "other  " + blanks + "1  2\n" +                //
                                "\n"
                                "arm    three  four\n"
                                "ideal      3  4\n"
                                "other     33\n");
    // A column that is too wide by itself is printed all the same.
    Table huge({{"a"}, {"b"}, {"c"}});
    huge.add_row({"x", std::string(120, 'b'), "c"});
    EXPECT_EQ(huge.text(), "a  b\nx  " + std::string(120, 'b') + "\n\na  c\nx  c\n");
}

TEST(ReportTable, RefusesCellsThatDoNotFit) {
    Table table({{"a"}});
    EXPECT_THROW(table.add_row({"1", "2"}), std::invalid_argument);
    EXPECT_THROW(table.add_row({"1\n2"}), std::invalid_argument);
    EXPECT_THROW(Table({{"a\n"}}), std::invalid_argument);
}

}  // namespace
}  // namespace report_table_test
