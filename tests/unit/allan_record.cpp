#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "engine/core/notice.hpp"
#include "tests/unit/allan_record_support.hpp"

// Series as text: columns, values, what is missing, whole numbers, streams.
namespace allan_record_test {
namespace {

using namespace ringlock;
using test::AllanRecord;
using test::same_numbers;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST_F(AllanRecord, ReadsOneColumnWithCommentsAndBlankLines) {
    const auto s = record::read_series(file("# a note\n1\n\n2.5e-3 # why\n  -3\n+4"), std::nullopt);
    EXPECT_THAT(s.values, ElementsAre(1.0, 2.5e-3, -3.0, 4.0));
    EXPECT_FALSE(s.rate_hz.has_value());
}

TEST_F(AllanRecord, ReadsCommasSpacesTabsWindowsLinesAndByteOrderMark) {
    EXPECT_THAT(record::read_series(file("\xEF\xBB\xBF"
                                         "1,10\r\n2,20\r\n"),
                                    "2")
                    .values,
                ElementsAre(10.0, 20.0));
    EXPECT_THAT(record::read_series(file(" 1 \t 10\n2  20 \n"), "1").values, ElementsAre(1.0, 2.0));
    EXPECT_THAT(record::read_series(file("1 , 10\n2,20"), "2").values, ElementsAre(10.0, 20.0));
}

TEST_F(AllanRecord, HeaderNamesColumnsAndOtherColumnsMayHoldText) {
    const auto path = file("time,rate,note\n2026-01-01,1.5,warm\n2026-01-02,2.5,cold\n");
    EXPECT_THAT(record::read_series(path, "rate").values, ElementsAre(1.5, 2.5));
    EXPECT_EQ(record::read_series(path, "2").column, "rate");
    EXPECT_THAT(record::read_series(file("rate_deg_h\n1\n2\n"), std::nullopt).values, ElementsAre(1.0, 2.0));
}

TEST_F(AllanRecord, EveryDatumHasItsLine) {
    const auto s = record::read_series(file("# a note\nrate\n1\n\n2\n3\n# more\nnan\n5\n"), std::nullopt);
    ASSERT_EQ(s.n, 5U);
    EXPECT_EQ(s.lines.size(), 3U);
    const std::vector<std::size_t> lines = {3, 5, 6, 8, 9};
    for (std::size_t datum = 0; datum < 5; ++datum) EXPECT_EQ(s.line_of(datum), lines[datum]) << datum;
    // Rows that are left out, by their times, are data without a line of their own.
    const auto gaps =
        record::read_series({.path = file("t,x\n0,1\n1,2\n4,3\n5,4\n"), .column = "x", .time = "t", .rate_hz = 1.0});
    ASSERT_EQ(gaps.n, 6U);
    EXPECT_EQ(gaps.line_of(1), 3U);
    EXPECT_EQ(gaps.line_of(4), 4U);
    EXPECT_EQ(gaps.line_of(5), 5U);
}

TEST_F(AllanRecord, ReadsTheRateOfAnRlgRecord) {
    const auto s = record::read_series(
        file("# format = rlg-record\n# rate_hz = 100\nangle_increment_arcsec,accel_x\n0.5,1\n-0.5,2\n"),
        "angle_increment_arcsec");
    EXPECT_EQ(s.rate_hz, 100.0);
    EXPECT_THAT(s.values, ElementsAre(0.5, -0.5));
    EXPECT_THAT(error_of(file("# rate_hz = fast\n1\n")),
                AllOf(HasSubstr(":1:"), HasSubstr("'fast'"), HasSubstr("positive")));
}

TEST_F(AllanRecord, ErrorsNameFileLineColumnAndWhatIsAllowed) {
    EXPECT_THAT(error_of(file("1 2\n3 4\n")),
                AllOf(HasSubstr("data.txt:1:"), HasSubstr("2 columns"), HasSubstr("--column")));
    EXPECT_THAT(error_of(file("a b\n3 4\n"), "c"), AllOf(HasSubstr("'c'"), HasSubstr("a, b")));
    EXPECT_THAT(error_of(file("1 2\n3 4\n"), "3"), AllOf(HasSubstr("'3'"), HasSubstr("1 to 2")));
    EXPECT_THAT(error_of(file("1\n2\nx3\n")),
                AllOf(HasSubstr("data.txt:3:"), HasSubstr("'x3'"), HasSubstr("not a number")));
    EXPECT_THAT(error_of(file("1\n2\n1e999\n")), HasSubstr("'1e999'"));
    EXPECT_THAT(error_of(file("1 2\n3\n"), "1"),
                AllOf(HasSubstr("data.txt:2:"), HasSubstr("1 column"), HasSubstr("2")));
    EXPECT_THAT(error_of(file("1\n-inf\n")), AllOf(HasSubstr("data.txt:2:"), HasSubstr("'-inf'"), HasSubstr("finite")));
    EXPECT_THAT(error_of(file("1\nNaNa\n")), AllOf(HasSubstr("data.txt:2:"), HasSubstr("'NaNa'")));
    EXPECT_THAT(error_of(file("")), HasSubstr("no data"));
    EXPECT_THAT(error_of(file("# only a comment\nname\n")), HasSubstr("no data"));
    EXPECT_THAT(error_of(directory_.path().string()), HasSubstr("directory"));
    EXPECT_THAT(error_of((directory_ / "absent").string()), AllOf(HasSubstr("absent"), HasSubstr("cannot be opened")));
}

// Lines that straddle the reader's buffer.
TEST_F(AllanRecord, LongFilesAreReadWhole) {
    std::string text;
    constexpr int rows = 100000;
    for (int i = 0; i < rows; ++i) text += std::to_string(i) + " " + std::to_string(0.5 * i) + "\n";
    const auto s = record::read_series(file(text), "2");
    ASSERT_EQ(s.values.size(), static_cast<std::size_t>(rows));
    for (int i = 0; i < rows; ++i) ASSERT_EQ(s.values[i], 0.5 * i);
    const std::string wide(600000, ' ');
    EXPECT_THAT(record::read_series(file("1\n" + wide + "2\n3\n"), std::nullopt).values, ElementsAre(1.0, 2.0, 3.0));
}

// A missing value keeps its place, whatever the gap was written as.
TEST_F(AllanRecord, MissingValuesAreKept) {
    const auto s = record::read_series(file("1\nnan\nNaN\nNA\nna\n-nan\n+NAN\n2.5\n"), std::nullopt);
    EXPECT_THAT(s.values, same_numbers({1.0, nan, nan, nan, nan, nan, nan, 2.5}));
    EXPECT_EQ(s.missing, 6u);
    EXPECT_EQ(s.n, 8u);
    const auto empty = record::read_series(file("a,b\n,\n1,2\nx,\n,4\nnan,NA\n"), "b");
    EXPECT_THAT(empty.values, same_numbers({nan, 2.0, nan, 4.0, nan}));
    EXPECT_EQ(empty.missing, 3u);
}

TEST_F(AllanRecord, OnlyMissingValuesOfTheColumnCount) {
    const auto s = record::read_series(file("1,nan\n2,\n3,NA\n4,inf\n"), "1");
    EXPECT_THAT(s.values, ElementsAre(1.0, 2.0, 3.0, 4.0));
    EXPECT_EQ(s.missing, 0u);
}

TEST_F(AllanRecord, AFirstRowOfMissingValuesIsNoHeader) {
    EXPECT_THAT(record::read_series(file("NA\n1\n"), std::nullopt).values, same_numbers({nan, 1.0}));
    EXPECT_THAT(record::read_series(file("nan -NA\n1 2\n"), "2").values, same_numbers({nan, 2.0}));
}

TEST_F(AllanRecord, NothingButMissingValuesIsAnError) {
    EXPECT_THAT(error_of(file("rate\nnan\nNA\n")),
                AllOf(HasSubstr("data.txt"), HasSubstr("column rate"), HasSubstr("all 2 values are missing")));
    EXPECT_THAT(error_of(file("1,\n2,\n"), "2"), HasSubstr("all 2 values are missing"));
}

TEST_F(AllanRecord, WholeNumbersBeyondDoublesAreKeptExactly) {
    const auto s = record::read_series(file("9007199254740993\nnan\n-9223372036854775808\n+9223372036854775807\n-1\n"),
                                       std::nullopt);
    EXPECT_THAT(s.counts, ElementsAre(9007199254740993, 0, std::numeric_limits<std::int64_t>::min(),
                                      std::numeric_limits<std::int64_t>::max(), -1));
    EXPECT_THAT(s.values, same_numbers({9007199254740992.0, nan, -0x1p63, 0x1p63, -1.0}));
    EXPECT_TRUE(s.rounded);
}

TEST_F(AllanRecord, CountsAreGivenOnlyWhereDoublesDoNotDo) {
    for (const char* text : {"9007199254740992\n-9007199254740992\n3\n", "9007199254740993\n1.5\n",
                             "1.5\n9007199254740993\n", "9007199254740993\n2e0\n", "1e17\n"}) {
        const auto s = record::read_series(file(text), std::nullopt);
        EXPECT_THAT(s.counts, IsEmpty()) << text;
        EXPECT_FALSE(s.rounded) << text;
    }
    EXPECT_EQ(record::read_series(file("9007199254740993\n1.5\n"), std::nullopt).values[0], 9007199254740992.0);
}

// The first number that a double rounds stands behind several pieces of others.
TEST_F(AllanRecord, CountsReachBackToTheFirstRow) {
    constexpr std::int64_t rows = 200000;
    std::string text;
    for (std::int64_t i = 0; i < rows; ++i) text += i % 7 == 3 ? "nan\n" : std::to_string(3 * i - rows) + "\n";
    const auto s = record::read_series(file(text + "9007199254740993\n5\n"), std::nullopt);
    ASSERT_EQ(s.counts.size(), static_cast<std::size_t>(rows) + 2);
    for (std::int64_t i = 0; i < rows; ++i) ASSERT_EQ(s.counts[i], i % 7 == 3 ? 0 : 3 * i - rows);
    EXPECT_EQ(s.counts[rows], 9007199254740993);
    EXPECT_EQ(s.counts[rows + 1], 5);
    const auto first = record::read_series(file("9007199254740993\n" + text), std::nullopt);
    ASSERT_EQ(first.counts.size(), static_cast<std::size_t>(rows) + 1);
    EXPECT_EQ(first.counts.front(), 9007199254740993);
    EXPECT_EQ(first.counts.back(), s.counts[rows - 1]);
    const auto rounded = record::read_series(file("9007199254740993\n" + text + "0.5\n"), std::nullopt);
    EXPECT_THAT(rounded.counts, IsEmpty());
    EXPECT_EQ(rounded.values.back(), 0.5);
}

TEST_F(AllanRecord, CountsBeyond64BitsAreRefusedUnlessTheColumnHoldsOthers) {
    EXPECT_THAT(error_of(file("1\nnan\n9223372036854775808\n2\n")),
                AllOf(HasSubstr("data.txt:3:"), HasSubstr("9223372036854775808"), HasSubstr("9223372036854775807")));
    EXPECT_THAT(error_of(file("-9223372036854775809\n")), HasSubstr("data.txt:1:"));
    EXPECT_THAT(record::read_series(file("1\n9223372036854775808\n0.5\n"), std::nullopt).values,
                ElementsAre(1.0, 0x1p63, 0.5));
}

TEST_F(AllanRecord, ReadsStandardInput) {
    const auto from_stdin = [&](const std::string& text, const record::SeriesRequest& request) {
        const std::string path = file(text);
        EXPECT_NE(std::freopen(path.c_str(), "rb", stdin), nullptr);
        return test::message_or([&] { record::read_series(request); }, "no error");
    };
    const record::SeriesRequest request{.path = "-", .column = std::nullopt, .time = std::nullopt};
    EXPECT_EQ(from_stdin("1\n2\n", request), "no error");
    EXPECT_THAT(from_stdin("1\nx\n", request), HasSubstr("standard input:2:"));
    EXPECT_THAT(from_stdin("\x89HDF\r\n\x1a\n", request), AllOf(HasSubstr("standard input"), HasSubstr("HDF5")));
    ASSERT_NE(std::freopen(file("3\n4\n").c_str(), "rb", stdin), nullptr);
    EXPECT_THAT(record::read_series(request).values, ElementsAre(3.0, 4.0));
}

// A pipe that has a name is opened and closed once: where it is closed and opened again, its writer may be gone, and
// reading waits for another.
TEST_F(AllanRecord, ReadsANamedPipeInOneGo) {
    const std::string path = (directory_ / "pipe").string();
    ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
    const int watch = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    ASSERT_GE(inotify_add_watch(watch, path.c_str(), IN_OPEN | IN_CLOSE_NOWRITE), 0);
    std::thread writer([&] { std::ofstream(path) << "1\n2\n"; });
    const auto s = record::read_series(path, std::nullopt);
    writer.join();
    EXPECT_THAT(s.values, ElementsAre(1.0, 2.0));
    int closed = 0;
    for (inotify_event event; ::read(watch, &event, sizeof event) == sizeof event;) {
        if ((event.mask & IN_CLOSE_NOWRITE) != 0) ++closed;
    }
    ::close(watch);
    EXPECT_EQ(closed, 1);
}

TEST_F(AllanRecord, StreamsTextInBoundedPieces) {
    std::string text = "# rate_hz = 5\nn x\n";
    std::vector<double> wanted;
    for (int i = 0; i < 150000; ++i) {
        const bool lost = i % 1000 == 17;
        text += lost ? std::to_string(i) + " nan\n" : fmt::format("{} {}.25\n", i, i);
        wanted.push_back(lost ? std::nan("") : i + 0.25);
    }
    const record::SeriesRequest request{.path = file(text), .column = "x", .time = std::nullopt};
    const auto streamed = test::stream(request);
    const auto read = record::read_series(request);
    EXPECT_THAT(streamed.values, same_numbers(wanted));
    EXPECT_THAT(read.values, same_numbers(wanted));
    EXPECT_LE(streamed.longest, 65536u);
    EXPECT_EQ(streamed.info.n, 150000u);
    EXPECT_EQ(streamed.info.missing, 150u);
    EXPECT_EQ(streamed.info.column, "x");
    EXPECT_EQ(streamed.info.rate_hz, 5.0);
}

// A summary below the table is used, and said.
TEST_F(AllanRecord, WordsBelowAColumnOfNumbersAreNoted) {
    const auto notes_of = [&](const std::string& text) {
        std::string notes;
        set_notice_sink([&](std::string_view said) { notes += said; });
        const auto series = record::read_series(file(text), "x");
        set_notice_sink({});
        EXPECT_GT(series.n, 11U);
        return notes;
    };
    std::string rows = "t,x\n";
    for (int i = 0; i < 12; ++i) rows += fmt::format("{}.5,{}\n", i, i);
    EXPECT_EQ(notes_of(rows + "nan,3\n,4\n-1,5\n"), "");
    EXPECT_THAT(notes_of(rows + "Mean,5\nStd,3\n"),
                AllOf(HasSubstr(":14: column t has 'Mean' where all rows above it have numbers"), HasSubstr("Cut off"),
                      Not(HasSubstr("Std"))));
    EXPECT_EQ(notes_of("t,x\nA7,1\n" + rows.substr(4) + "Mean,5\n"), "") << "a column of names";
}

// Whatever the bytes are: a series that adds up, or an error that names the file.
TEST_F(AllanRecord, AnyTextIsASeriesOrAnError) {
    std::mt19937_64 engine(3);
    const std::vector<std::string> parts = {"1",
                                            "-2.5",
                                            "1e3",
                                            "nan",
                                            "NA",
                                            ",",
                                            ",",
                                            " ",
                                            "\n",
                                            "\n",
                                            "\n",
                                            "\r\n",
                                            "#",
                                            "# rate_hz = 2\n",
                                            "inf",
                                            "x",
                                            "9007199254740993",
                                            "99999999999999999999",
                                            "\t",
                                            std::string(1, '\0'),
                                            "\xff",
                                            "+",
                                            "."};
    int read = 0, refused = 0;
    for (int trial = 0; trial < 1000; ++trial) {
        // Few different parts make texts that agree with themselves now and then.
        const std::size_t kinds = 1 + engine() % parts.size();
        const std::size_t first = engine() % parts.size();
        std::string text;
        for (std::size_t i = engine() % 12; i > 0; --i) text += parts[(first + engine() % kinds) % parts.size()];
        record::SeriesRequest request{file(text), std::nullopt, std::nullopt, 1.0};
        if (engine() % 2 == 0) request.column = "1";
        if (engine() % 4 == 0) request.time = "2";
        const std::string error = test::message_or(
            [&] {
                const auto s = record::read_series(request);
                ++read;
                EXPECT_EQ(s.values.size(), s.n) << text;
                std::size_t missing = 0;
                for (const double v : s.values) {
                    missing += std::isnan(v) ? 1 : 0;
                    EXPECT_FALSE(std::isinf(v)) << text;
                }
                EXPECT_EQ(missing, s.missing) << text;
                EXPECT_LT(missing, s.n) << text;
                EXPECT_EQ(s.counts.size(), s.rounded ? s.n : 0) << text;
                EXPECT_THAT(test::stream(request).values, same_numbers(s.values)) << text;
            },
            "");
        if (error.empty()) continue;
        ++refused;
        EXPECT_THAT(error, HasSubstr("data.txt")) << text;
    }
    EXPECT_GT(read, 25);
    EXPECT_GT(refused, 25);
}

// Doubles alone are streamed; who streams is told that they are not all that there was.
TEST_F(AllanRecord, AStreamSaysWhereItsValuesAreRounded) {
    EXPECT_TRUE(test::stream({.path = file("9007199254740993\n1\n"), .column = {}, .time = {}}).info.rounded);
    EXPECT_FALSE(test::stream({.path = file("9007199254740993\n1.5\n"), .column = {}, .time = {}}).info.rounded);
}

// Real data, where it is there: RINGLOCK_TEST_DATA names the folder.
TEST(AllanRecordMeasured, LaserGyroRecordIsReadWhole) {
    const char* folder = std::getenv("RINGLOCK_TEST_DATA");
    const std::filesystem::path path =
        std::filesystem::path(folder != nullptr ? folder : RINGLOCK_SHARED_DATA) / "laser-gyro-triad-x.csv";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there; set RINGLOCK_TEST_DATA to its folder";
    const auto s = record::read_series(path.string(), "angle_increment_arcsec");
    EXPECT_EQ(s.values.size(), 184718u);
    EXPECT_EQ(s.rate_hz, 100.0);
}

}  // namespace
}  // namespace allan_record_test
