// Tables in text: numbers, fields, headers, and what is told from what.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "analysis/text/columns.hpp"
#include "analysis/text/layout/units.hpp"
#include "analysis/text/numbers.hpp"
#include "analysis/text/table.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/notice.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/packed_text.hpp"

namespace ringlock::text {
namespace text_layout_test {
namespace {

using test::message_of;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// What is read of a text.
struct Read {
    std::vector<std::string> headings, units;
    std::vector<std::vector<std::string>> rows;
    std::vector<std::string> comments;
    std::string notes;
    Layout layout;
};

Read read(const std::string& text, const Options& options = {}, const Wanted& wanted = {}) {
    Read out;
    set_notice_sink([&](std::string_view said) { out.notes += std::string(said) + "\n"; });
    const auto silent = [](void*) { set_notice_sink({}); };
    const std::unique_ptr<int, decltype(silent)> restore(reinterpret_cast<int*>(1), silent);
    Table table(std::make_unique<test::StringSource>(text), "data", options, wanted,
                [&](std::size_t, std::string_view comment) { out.comments.emplace_back(comment); });
    out.layout = table.layout();
    for (const Column& column : table.layout().columns) {
        out.headings.push_back(column.heading);
        out.units.push_back(column.unit);
    }
    while (table.next()) out.rows.emplace_back(table.fields().begin(), table.fields().end());
    return out;
}

using Row = std::vector<std::string>;

TEST(TextNumbers, AreReadAsProgramsWriteThem) {
    const auto value = [](std::string_view field, bool comma = false) {
        double out = 0.0;
        return parse_value(field, out, comma) ? out : -999.0;
    };
    for (const auto& [field, expected] : std::vector<std::pair<const char*, double>>{{"1.5D-03", 1.5e-3},
                                                                                     {"-2d2", -200.0},
                                                                                     {"1.25-103", 1.25e-103},
                                                                                     {"+4", 4.0},
                                                                                     {".5", 0.5},
                                                                                     {"5.", 5.0},
                                                                                     {"1E+3", 1000.0}}) {
        EXPECT_EQ(value(field), expected) << field;
    }
    for (const char* field : {"", "nan", "-nan", "NaN(ind)", "-nan(ind)", "1.#QNAN", "-1.#IND", "1.#QNAN0", "-1.#IND00",
                              "1.#SNAN", "null", "NULL", "NA", "N/A", "n/a", "-NA", "none", "--", "-"}) {
        EXPECT_TRUE(std::isnan(value(field))) << field;
    }
    EXPECT_EQ(value("1.#INF"), std::numeric_limits<double>::infinity());
    EXPECT_EQ(value("-1.#INF00"), -std::numeric_limits<double>::infinity());
    for (const char* field : {"x", "1.2.3", "1,5", "1e999", "0x1F", "1.#", "1.#WHAT", "12:30", "2024-05", "2024-05-01",
                              "1 2", "1.5DD3", "+-1", "."}) {
        EXPECT_EQ(value(field), -999.0) << field;
    }
    EXPECT_EQ(value("-0,25", true), -0.25);
    EXPECT_EQ(value("1,5E-3", true), 1.5e-3);
    EXPECT_TRUE(std::isnan(value("1,#QNAN", true)));
    for (const char* field : {"1.234,5", "1,234,5", "1,", ",x"}) EXPECT_EQ(value(field, true), -999.0) << field;
}

TEST(TextUnits, AreToldFromOtherBrackets) {
    for (const char* unit :
         {"deg/s", "rad s^-1", "m/s^2", "m/s²", "degC", "°/s", "ns", "deg/sqrt(h)", "%", "rad·s⁻¹"}) {
        EXPECT_TRUE(is_unit(unit)) << unit;
    }
    for (const char* other : {"0", "x", "raw", "1", "", "-", "gyro", "2/3"}) EXPECT_FALSE(is_unit(other)) << other;
    const auto parts = [](const char* heading) {
        const NameAndUnit found = split_unit(heading);
        return std::pair(found.name, found.unit);
    };
    EXPECT_EQ(parts("Gyro X (deg/s)"), std::pair(std::string("Gyro X"), std::string("deg/s")));
    EXPECT_EQ(parts("w_x [rad s^-1]"), std::pair(std::string("w_x"), std::string("rad s^-1")));
    EXPECT_EQ(parts("n (deg/sqrt(h))"), std::pair(std::string("n"), std::string("deg/sqrt(h)")));
    EXPECT_EQ(parts("gyroADC[0]"), std::pair(std::string("gyroADC[0]"), std::string()));
    EXPECT_EQ(parts("(s)"), std::pair(std::string("(s)"), std::string()));
}

TEST(TextLayout, DelimitersAndDecimalCommas) {
    const std::vector<Row> rows = {{"1.5", "-2"}, {"2.5", "4"}};
    EXPECT_EQ(read("1.5,-2\n2.5,4\n").rows, rows);
    EXPECT_EQ(read("1.5;-2\n2.5;4\n").rows, rows);
    EXPECT_EQ(read("1.5\t-2\n2.5\t4\n").rows, rows);
    EXPECT_EQ(read("  1.5   -2 \n2.5\t4\n").rows, rows);
    Options bars;
    set_delimiter(bars, "|");
    EXPECT_EQ(read("1.5|-2\n2.5 | 4\n", bars).rows, rows);
    for (const char* text : {"1,5;-2\n2,5;4\n", "1,5\t-2\n2,5\t4\n", "1,5 -2\n2,5 4\n"}) {
        const Read found = read(text);
        EXPECT_TRUE(found.layout.dialect.decimal_comma) << text;
        EXPECT_EQ(found.rows.size(), 2u);
        EXPECT_EQ(found.rows[0], (Row{"1,5", "-2"})) << text;
        EXPECT_THAT(found.notes, HasSubstr("decimal commas")) << text;
    }
    EXPECT_EQ(read("gx\n0,12\n-0,3\n").layout.dialect, (Dialect{' ', true}));
    EXPECT_EQ(read("0,12\n0,3\n").layout.dialect.delimiter, ',');
    // A row that is short is no reason for another dialect.
    EXPECT_THAT(message_of<InputError>([] { read("a,b\n1,2\n3\n"); }),
                AllOf(HasSubstr("data:3:"), HasSubstr("1 column")));
    EXPECT_EQ(read("a\tb\tc\n1\t\t3\n\t2\t\n").rows, (std::vector<Row>{{"1", "", "3"}, {"", "2", ""}}));
    EXPECT_EQ(read("a,b,\n1,2,\n").rows, (std::vector<Row>{{"1", "2", ""}}));
    EXPECT_EQ(read("a,b\n1,2,\n3,4,\n").headings, (Row{"a", "b", ""}));
}

TEST(TextLayout, QuotesAndComments) {
    const Read quoted = read("\"t, s\",\"a \"\"b\"\"\"\n\"0.5\", \"1\" \n1,\"2\" # note\n# whole\n3,4#5\n");
    EXPECT_EQ(quoted.headings, (Row{"t, s", "a \"b\""}));
    EXPECT_EQ(quoted.rows, (std::vector<Row>{{"0.5", "1"}, {"1", "2"}, {"3", "4#5"}}));
    EXPECT_THAT(quoted.comments, ElementsAre("whole"));
    EXPECT_EQ(read("1.#QNAN 2\n3 4 # 5\n").rows, (std::vector<Row>{{"1.#QNAN", "2"}, {"3", "4"}}));
    EXPECT_EQ(read("Gyro #1,Gyro #2\n1,2\n").headings, (Row{"Gyro #1", "Gyro #2"}));
    EXPECT_EQ(read("% a\n// b\n1;2\n").comments, (Row{"a", "b"}));
    EXPECT_EQ(read("; a\n1 2\n").comments, (Row{"a"}));
    EXPECT_EQ(read(";0;1\n0;1.5;2.5\n1;2.5;3.5\n").headings, (Row{"", "0", "1"})) << "no comment";
    EXPECT_THAT(message_of<InputError>([] { read("a,b\n1,2\n\"3,4\n"); }),
                AllOf(HasSubstr("data:3: column 1"), HasSubstr("quotes")));
    EXPECT_THAT(message_of<InputError>([] { read("a,b\n1,\"2\" x\n3,4\n5,6\n"); }), HasSubstr("data:2: column 2"));
}

TEST(TextLayout, HeadersWithUnits) {
    const Row names{"t", "gx"}, units{"s", "rad/s"};
    for (const char* text :
         {"t [s],gx [rad/s]\n0,1\n", "t,gx\n(s),(rad/s)\n0,1\n", "t,gx\n[s],[rad/s]\n0,1\n", "t,gx\ns,rad/s\n0,1\n",
          "# t [s],gx [rad/s]\n0,1\n", "#t,gx\n#s,rad/s\n0,1\n", "% t (s) gx (rad/s)\n0 1\n", "// t,gx\ns,rad/s\n0,1\n",
          "t [s] gx [rad/s]\n0 1\n", "t (s)   gx (rad/s)\n0  1\n", "t (s)\tgx (rad/s)\n0 1\n",
          "t,gx\n\n(s),(rad/s)\n\n0,1\n"}) {
        const Read found = read(text);
        ASSERT_EQ(found.layout.columns.size(), 2u) << text;
        EXPECT_EQ(found.layout.columns[0].name, "t") << text;
        EXPECT_EQ(found.layout.columns[1].name, "gx") << text;
        EXPECT_EQ(found.units, units) << text;
        EXPECT_EQ(found.rows, (std::vector<Row>{{"0", "1"}})) << text;
    }
    EXPECT_EQ(read("s,V\n0,1\n").headings, (Row{"s", "V"})) << "a header of units is one of names";
    EXPECT_EQ(read("# a note\n1\n2\n").layout.has_header, false);
    EXPECT_EQ(read("# rate_hz = 3\n1 2 3\n").layout.has_header, false);
}

TEST(TextLayout, ARowOfAWordAndAOneIsNoRowOfUnits) {
    EXPECT_THAT(read("state,x\nN,1\nC,0.5\nN,0.25\n").rows,
                ElementsAre(Row{"N", "1"}, Row{"C", "0.5"}, Row{"N", "0.25"}));
    EXPECT_THAT(read("t,x,n\ns,deg/s,1\n0,0.5,2\n1,0.25,3\n").units, ElementsAre("s", "deg/s", ""));
}

TEST(TextLayout, PreamblesAreLeftAside) {
    std::string long_one;
    for (int i = 0; i < 30000; ++i)
        long_one += "# line " + std::to_string(i) + " of a log that says much before it begins\n";
    EXPECT_EQ(read(long_one + "t,x\n0,1\n").headings, (Row{"t", "x"}));
    std::string words;
    for (int i = 0; i < 3000; ++i) words += "Parameter " + std::to_string(i) + ": unknown\n";
    const Read found = read("Start Time: Unknown\n" + words + "\nt,x\n0,1\n2,3\n");
    EXPECT_EQ(found.headings, (Row{"t", "x"}));
    EXPECT_EQ(found.rows.size(), 2u);
    EXPECT_THAT(found.notes, AllOf(HasSubstr("line 3003 is taken for the header"), HasSubstr("3001 lines of text")));
    // Numbers are never left aside without a word.
    EXPECT_THAT(message_of<InputError>([] { read("3\nt,x\n0,1\n2,3\n"); }),
                AllOf(HasSubstr("data:1:"), HasSubstr("1 column where the rows below have 2"), HasSubstr("--skip")));
    Options skip;
    skip.skip = 1;
    EXPECT_EQ(read("3\nt,x\n0,1\n2,3\n", skip).headings, (Row{"t", "x"}));
}

TEST(TextLayout, HeadersOfNumbers) {
    const Read pandas = read(",0,1,2\n0,0.5,1.5,2.5\n1,0.6,1.6,2.6\n");
    EXPECT_EQ(pandas.headings, (Row{"", "0", "1", "2"}));
    EXPECT_EQ(pandas.rows.size(), 2u);
    EXPECT_THAT(pandas.notes, HasSubstr("line 1 is taken for the header"));
    const Read plain = read("0,1,2\n0.5,1.5,2.5\n0.6,1.6,2.6\n0.7,1.7,2.7\n");
    EXPECT_EQ(plain.headings, (Row{"0", "1", "2"}));
    EXPECT_THAT(plain.notes, HasSubstr("line 1 is taken for the header"));
    EXPECT_EQ(read("0,1,2\n1,2,3\n2,3,4\n3,4,5\n").rows.size(), 4u) << "rows like the first";
    EXPECT_EQ(read("0,1\n0.5,1\n1,1.5\n1.5,2\n").rows.size(), 4u);
    Options no;
    set_header(no, "no");
    EXPECT_EQ(read("0,1,2\n0.5,1.5,2.5\n0.6,1.6,2.6\n0.7,1.7,2.7\n", no).rows.size(), 4u);
    // A name above the index, a number above the wanted column.
    const Wanted second{{"2"}, false};
    EXPECT_EQ(read("i,0\n0,0.5\n1,0.6\n", {}, second).rows.size(), 2u);
    const Read data = read("broken,0.4\n0,0.5\n1,0.6\n", {}, second);
    EXPECT_EQ(data.rows.size(), 3u);
    EXPECT_THAT(data.notes, HasSubstr("line 1 is taken for a row of data"));
}

TEST(TextLayout, OptionsDecide) {
    Options options;
    set_header(options, "2");
    EXPECT_EQ(read("a,b\n7,8\n1,2\n", options).headings, (Row{"7", "8"}));
    set_header(options, "yes");
    EXPECT_EQ(read("7,8\n1,2\n", options).headings, (Row{"7", "8"}));
    EXPECT_EQ(read("7,8\n1,2\n", options).rows.size(), 1u);
    set_header(options, "9");
    EXPECT_THAT(message_of<InputError>([&] { read("7,8\n1,2\n", options); }), HasSubstr("data:9: --header 9"));
    set_header(options, "1");
    EXPECT_THAT(message_of<InputError>([&] { read("a b c d\n1,2\n", options); }), HasSubstr("data:1:"));
    for (const char* word : {"maybe", "0", "-1", "1.5", ""}) {
        EXPECT_THAT(message_of<InputError>([&] { set_header(options, word); }), HasSubstr("--header"));
    }
    for (const char* word : {"commas", "1", "-", "#", "", "\""}) {
        Options other;
        EXPECT_THAT(message_of<InputError>([&] { set_delimiter(other, word); }), HasSubstr("--delimiter")) << word;
    }
}

// A comma cannot be both. Zeros in front of whole numbers alone are no fault: counters are padded so.
TEST(TextLayout, DecimalCommasBetweenCommasAreRefused) {
    const std::string rows = "0,000,0,012\n0,005,-0,003\n0,010,1,250\n";
    const auto refused = [](const std::string& text) { return message_of<InputError>([&] { read(text); }); };
    EXPECT_THAT(refused(rows), AllOf(HasSubstr("data:1: commas seem"), HasSubstr("4 whole numbers"),
                                     HasSubstr("by semicolons or tabs"), HasSubstr("--delimiter comma")));
    EXPECT_THAT(refused("t,x\n0,000,0,012\n0,005,1,250\n"), HasSubstr("data:2: commas seem"));
    EXPECT_THAT(refused("0,012\n-0,003\n"), HasSubstr("Put the name of the column above"));
    EXPECT_THAT(read("x\n0,012\n-0,003\n").rows, ElementsAre(Row{"0,012"}, Row{"-0,003"}));
    Options options;
    set_delimiter(options, "comma");
    EXPECT_EQ(read(rows, options).rows.front(), (Row{"0", "000", "0", "012"}));
    for (const char* good : {"0,0007\n1,0008\n", "-0,12\n3,4\n", "-0,0.05\n1,2\n",
                             "a,b,c,d\n0,000,0,012\n0,005,-0,003\n", "-0,05,1\n0,06,2\n", "-0,-05\n1,2\n"}) {
        EXPECT_NO_THROW(read(good)) << good;
    }
}

TEST(TextLayout, ColumnsAreFoundByNameOrNumber) {
    const Layout layout = read("Time (s),Gyro X (deg/s),x,x,7\n0,1,2,3,4\n").layout;
    const auto column = [&](const std::string& asked) { return find_column(layout, asked, "data"); };
    EXPECT_EQ(column("Gyro X (deg/s)"), 1u);
    EXPECT_EQ(column("\"Gyro X (deg/s)\""), 1u);
    EXPECT_EQ(column("Gyro X"), 1u);
    EXPECT_EQ(column("3"), 2u);
    EXPECT_EQ(column("7"), 4u) << "a name before a number";
    EXPECT_THAT(message_of<InputError>([&] { column("x"); }),
                AllOf(HasSubstr("several columns: 3, 4"), HasSubstr("data:1:")));
    EXPECT_THAT(message_of<InputError>([&] { column("gyro x"); }),
                AllOf(HasSubstr("did you mean 'Gyro X'"), HasSubstr("Time (s)")));
    EXPECT_THAT(message_of<InputError>([&] { column("9"); }), HasSubstr("no column '9'"));
}

}  // namespace
}  // namespace text_layout_test
}  // namespace ringlock::text
