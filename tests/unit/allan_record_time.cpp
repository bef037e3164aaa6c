#include <fmt/format.h>

#include <cstdint>
#include <random>

#include "tests/unit/allan_record_support.hpp"

// Rows placed by their time stamps.
namespace allan_record_time_test {
namespace {

using namespace ringlock;
using test::AllanRecord;
using test::same_numbers;
using testing::AllOf;
using testing::HasSubstr;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

class AllanRecordTime : public AllanRecord {
   protected:
    /// Rows "time value" of values 1, 2, ...
    static std::string rows(const std::vector<double>& times_s) {
        std::string text;
        for (std::size_t i = 0; i < times_s.size(); ++i) text += fmt::format("{:.17g} {}\n", times_s[i], i + 1);
        return text;
    }
    record::SeriesRequest request(const std::vector<double>& times_s, double rate_hz) const {
        return {file(rows(times_s)), "2", "1", rate_hz};
    }
    record::Series read(const std::vector<double>& times_s, double rate_hz) const {
        return record::read_series(request(times_s, rate_hz));
    }
    std::string refusal(const std::vector<double>& times_s, double rate_hz) const {
        return error_of(request(times_s, rate_hz));
    }
    /// Of n rows that miss nothing, `interval_s` apart.
    static std::vector<double> uniform(int n, double interval_s, double from_s = 0.0) {
        std::vector<double> times_s;
        for (int i = 0; i < n; ++i) times_s.push_back(from_s + i * interval_s);
        return times_s;
    }
};

TEST_F(AllanRecordTime, RowsLeftOutAreMissing) {
    const auto s = read({5.0, 5.1, 5.4, 5.5, 5.7}, 10.0);
    EXPECT_THAT(s.values, same_numbers({1.0, 2.0, nan, nan, 3.0, 4.0, nan, 5.0}));
    EXPECT_EQ(s.missing, 3u);
    EXPECT_EQ(s.column, "2");
    EXPECT_EQ(read({5.0, 5.1, 5.2}, 10.0).missing, 0u);
}

TEST_F(AllanRecordTime, MissingValuesAndMissingRowsAddUp) {
    const auto path = file("t,x\n0,NA\n1,2\n3,\n4,5\n5,nan\n");
    const auto s = record::read_series(record::SeriesRequest{path, "x", "t", 1.0});
    EXPECT_THAT(s.values, same_numbers({nan, 2.0, nan, nan, 5.0, nan}));
    EXPECT_EQ(s.missing, 4u);
}

TEST_F(AllanRecordTime, TheColumnNeedsNoNameBesideTheTime) {
    EXPECT_THAT(record::read_series(record::SeriesRequest{file("x,t\n7,1\n8,2\n"), {}, "t", 1.0}).values,
                same_numbers({7.0, 8.0}));
    EXPECT_THAT(error_of(record::SeriesRequest{file("x,t,y\n7,1,3\n"), {}, "t", 1.0}),
                AllOf(HasSubstr(":1:"), HasSubstr("3 columns, of which t is the time"), HasSubstr("--column")));
    EXPECT_THAT(error_of(record::SeriesRequest{file("t\n1\n"), {}, "t", 1.0}), HasSubstr("1 column,"));
    EXPECT_THAT(error_of(record::SeriesRequest{file("x,t\n7,1\n"), "x", "time", 1.0}),
                AllOf(HasSubstr("'time'"), HasSubstr("x, t")));
}

// Rows left out, with stamps of a clock that jitters and runs off, and nan written in their place are one series.
TEST_F(AllanRecordTime, RandomGapsComeBackWhereTheyWere) {
    std::mt19937_64 engine(7);
    const auto uniform_in = [&](double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(engine);
    };
    for (int trial = 0; trial < 60; ++trial) {
        const double rate_hz = std::pow(10.0, uniform_in(-3.0, 4.0));
        const double start_s = trial % 3 == 0 ? 0.0 : uniform_in(-1e3, 1e5) / rate_hz;
        const double clock = 1.0 + uniform_in(-3e-4, 3e-4);
        // Two stamps that are each a tenth off, and where the grid lags behind, stay within a quarter.
        const double jitter = trial % 2 == 0 ? 0.1 : 0.0;
        const double kept = uniform_in(0.2, 1.0);
        std::string stamped, plain;
        std::size_t missing = 0, pending = 0;
        for (int i = 0; i < 3000; ++i) {
            const bool in_long_gap = i > 1500 && i < 1500 + trial;
            if (i > 0 && (in_long_gap || uniform_in(0.0, 1.0) > kept)) {
                ++pending;
                continue;
            }
            for (; pending > 0; --pending, ++missing) plain += "nan\n";
            const double value = i % 50 == 3 ? nan : uniform_in(-1.0, 1.0);
            missing += std::isnan(value) ? 1 : 0;
            stamped +=
                fmt::format("{:.17g},{:.17g}\n", start_s + (i + uniform_in(-jitter, jitter)) * clock / rate_hz, value);
            plain += fmt::format("{:.17g}\n", value);
        }
        const auto placed = record::read_series(record::SeriesRequest{file(stamped), "2", "1", rate_hz});
        const auto written = record::read_series(file(plain), std::nullopt);
        ASSERT_EQ(placed.n, written.n) << trial;
        ASSERT_THAT(placed.values, same_numbers(written.values)) << trial;
        EXPECT_EQ(placed.missing, missing) << trial;
        EXPECT_EQ(written.missing, missing) << trial;
    }
}

// Milliseconds at 430 Hz: no stamp is off by more than 0.215 intervals, but two rows are up to 1.29 apart.
TEST_F(AllanRecordTime, RoundedStampsStayOnTheGrid) {
    std::vector<double> times_s;
    for (int i = 0; i < 20000; ++i) times_s.push_back(std::round(1000.0 * i / 430.0) / 1000.0);
    EXPECT_EQ(read(times_s, 430.0).missing, 0u);
    times_s.erase(times_s.begin() + 777, times_s.begin() + 780);
    EXPECT_EQ(read(times_s, 430.0).missing, 3u);
    // The mean rate of so few rows is wrong by more than a thousandth, by the rounding alone.
    for (std::size_t n = 3; n < 60; ++n)
        EXPECT_EQ(refusal({times_s.begin(), times_s.begin() + n}, 430.0), "no error") << n;
}

// The clock runs 1e-4 off, two whole samples in the gap: what it did before tells how many are missing.
TEST_F(AllanRecordTime, AGapIsMeasuredByTheClockOfTheStamps) {
    std::vector<double> times_s;
    for (int i = 0; i < 5000; ++i) times_s.push_back(i * 1.0001);
    for (int i = 25000; i < 25100; ++i) times_s.push_back(i * 1.0001);
    const auto s = read(times_s, 1.0);
    EXPECT_EQ(s.n, 25100u);
    EXPECT_EQ(s.missing, 20000u);
    EXPECT_EQ(s.values[25000], 5001.0);
}

TEST_F(AllanRecordTime, TimesOffTheGridNameBothRows) {
    EXPECT_THAT(refusal({0.0, 1.0, 2.4}, 1.0),
                AllOf(HasSubstr("data.txt:3: column 1"), HasSubstr("2.4 s"), HasSubstr("1.4 sampling intervals"),
                      HasSubstr("1 s of the row before it"), HasSubstr("data.txt:2")));
    EXPECT_THAT(refusal({0.0, 0.2}, 1.0), AllOf(HasSubstr("data.txt:2"), HasSubstr("0.2 sampling intervals")));
    EXPECT_THAT(refusal({0.0, 0.9}, 1.0), HasSubstr("no error"));
    EXPECT_THAT(refusal({0.0, 1.0, 0.5}, 1.0),
                AllOf(HasSubstr("data.txt:3"), HasSubstr("0.5 s is before the 1 s"), HasSubstr("data.txt:2")));
    EXPECT_THAT(refusal({0.0, 1.0, 1.0}, 1.0), AllOf(HasSubstr("data.txt:3"), HasSubstr("1 s repeats the 1 s")));
}

TEST_F(AllanRecordTime, TimesThatAreMissingOrNoNumbersAreNamed) {
    const auto refused = [&](const std::string& text) {
        return error_of(record::SeriesRequest{file("t,x\n" + text), "x", "t", 1.0});
    };
    EXPECT_THAT(refused("0,1\n,2\n"), AllOf(HasSubstr("data.txt:3: column t"), HasSubstr("no time")));
    EXPECT_THAT(refused("nan,1\n2,2\n"), AllOf(HasSubstr("data.txt:2: column t"), HasSubstr("no time")));
    EXPECT_THAT(refused("0,1\n1,2\ninf,3\n"), AllOf(HasSubstr("data.txt:4: column t"), HasSubstr("infinite")));
    EXPECT_THAT(refused("0,1\n12:30:00,2\n"),
                AllOf(HasSubstr("data.txt:3: column t"), HasSubstr("'12:30:00'"), HasSubstr("seconds")));
}

TEST_F(AllanRecordTime, ARateThatTheStampsContradictIsAnError) {
    for (const int n : {10, 40, 3000}) {
        EXPECT_THAT(refusal(uniform(n, 0.0101), 100.0),
                    AllOf(HasSubstr("contradicts the rate of 100 Hz"), HasSubstr("say 99.0099")))
            << n;
        EXPECT_EQ(refusal(uniform(n, 0.010005, 3.0), 100.0), "no error") << n;
    }
    EXPECT_THAT(refusal(uniform(3000, 0.00998), 100.0), HasSubstr("contradicts"));
    // Every step is a gap, or the time is in milliseconds.
    EXPECT_THAT(refusal(uniform(50, 0.02), 100.0), AllOf(HasSubstr("closer than 2 intervals"), HasSubstr("100 Hz")));
    EXPECT_THAT(refusal(uniform(50, 10.0), 100.0), HasSubstr("say --time-unit ms"));
    EXPECT_THAT(refusal(uniform(50, 7.0), 100.0), HasSubstr("not in seconds"));
    for (const double rate_hz : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()}) {
        EXPECT_THAT(refusal(uniform(3, 1.0), rate_hz), HasSubstr("sampling rate")) << rate_hz;
    }
}

TEST_F(AllanRecordTime, AHugeGapIsAnErrorAndNoAllocation) {
    EXPECT_THAT(refusal({0.0, 1.0, 2e9}, 1.0),
                AllOf(HasSubstr("data.txt:3"), HasSubstr("2000000000 s"), HasSubstr("2e+09"), HasSubstr("data.txt:2")));
    EXPECT_THAT(refusal({0.0, 1.0, 1e300}, 1.0), HasSubstr("data.txt:3"));
    EXPECT_THAT(refusal({-1e308, 1e308}, 1e9), HasSubstr("data.txt:2"));
    // Each of the two alone would do.
    const auto both = request({0.0, 1.0, 2.0, 6e5, 6e5 + 1.0, 1.2e6}, 1.0);
    EXPECT_THAT(test::message_or([&] { test::stream(both); }, "no error"),
                AllOf(HasSubstr("data.txt:6"), HasSubstr("in all")));
    EXPECT_EQ(refusal({0.0, 1.0, 2.0, 6e5, 6e5 + 1.0, 9e5}, 1.0), "no error");
}

// What is left out may grow with what is there: 20 for each row.
TEST_F(AllanRecordTime, LongRecordsMayLeaveMoreOut) {
    std::vector<double> times_s = uniform(60000, 1.0);
    times_s.push_back(59999.0 + 1.19e6);
    EXPECT_EQ(refusal(times_s, 1.0), "no error");
    times_s.back() = 59999.0 + 1.21e6;
    EXPECT_THAT(refusal(times_s, 1.0), HasSubstr("data.txt:60001"));
}

TEST_F(AllanRecordTime, LongGapsAreStreamedInBoundedPieces) {
    const auto streamed = test::stream(request({0.0, 1.0, 9e5, 9e5 + 1.0}, 1.0));
    EXPECT_LE(streamed.longest, 65536u);
    EXPECT_EQ(streamed.info.n, 900002u);
    EXPECT_EQ(streamed.info.missing, 899998u);
    ASSERT_EQ(streamed.values.size(), 900002u);
    EXPECT_EQ(streamed.values[900000], 3.0);
    EXPECT_TRUE(std::isnan(streamed.values[899999]));
}

// A quarter of an interval to either side is allowed and no more, whatever the first stamp happens to be.
TEST_F(AllanRecordTime, JitterIsAllowedUpToAQuarter) {
    std::mt19937_64 engine(11);
    for (const int rows : {2, 3, 5, 10, 60, 64, 65, 500, 5000}) {
        for (int trial = 0; trial < 40; ++trial) {
            const double clock = 1.0 + std::uniform_real_distribution<double>(-2e-5, 2e-5)(engine);
            std::vector<double> times_s;
            for (int i = 0; i < rows; ++i) {
                const double off = std::uniform_real_distribution<double>(-0.2499, 0.2499)(engine);
                times_s.push_back((i * clock + off) / 200.0);
            }
            const std::string said = refusal(times_s, 200.0);
            if (rows >= 10) {
                ASSERT_EQ(said, "no error") << rows;
            }
        }
    }
    for (const int rows : {60, 500}) {
        std::vector<double> times_s;
        for (int i = 0; i < rows; ++i) times_s.push_back((i + (i % 2 == 0 ? 0.26 : -0.26)) / 200.0);
        EXPECT_THAT(refusal(times_s, 200.0), AllOf(HasSubstr("off the grid"), HasSubstr("0.25"))) << rows;
    }
    // One stamp among others without jitter, at the start and far behind it: its advance is that from the row before.
    for (const std::size_t at : {3U, 40U, 400U}) {
        std::vector<double> times_s = uniform(500, 0.005);
        times_s[at] += 0.4 * 0.005;
        EXPECT_THAT(refusal(times_s, 200.0),
                    AllOf(HasSubstr(fmt::format("data.txt:{}:", at + 1)), HasSubstr("1.4 sampling intervals"),
                          HasSubstr("0.4 intervals off the grid")));
        times_s[at] -= 0.2 * 0.005;
        EXPECT_EQ(refusal(times_s, 200.0), "no error");
    }
}

// Units.

TEST_F(AllanRecordTime, UnitsOfTimes) {
    const auto in_unit = [&](double seconds, const std::optional<std::string>& unit) {
        record::SeriesRequest asked = request(uniform(100, 0.005 / seconds), 200.0);
        asked.time_unit = unit;
        return asked;
    };
    for (const auto& [unit, seconds] : {std::pair{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}}) {
        const auto s = record::read_series(in_unit(seconds, unit));
        EXPECT_EQ(s.n, 100u) << unit;
        EXPECT_EQ(s.missing, 0u) << unit;
        if (seconds == 1.0) continue;
        EXPECT_THAT(error_of(in_unit(seconds, std::nullopt)),
                    AllOf(HasSubstr("are taken to be in s"), HasSubstr(fmt::format("say --time-unit {}", unit))));
    }
    EXPECT_THAT(error_of(in_unit(1.0, "ms")), HasSubstr("say --time-unit s"));
    EXPECT_THAT(error_of(in_unit(1.0, "fortnight")), AllOf(HasSubstr("fortnight"), HasSubstr("mjd")));
    EXPECT_THAT(error_of(in_unit(1.0, "iso")), AllOf(HasSubstr("is not a date"), HasSubstr("data.txt:1")));
    record::SeriesRequest days = request({60431.0, 60431.25, 60431.75, 60432.0}, 4.0 / 86400.0);
    days.time_unit = "mjd";
    EXPECT_THAT(record::read_series(days).values, same_numbers({1.0, 2.0, nan, 3.0, 4.0}));
}

TEST_F(AllanRecordTime, StampsKeepAllTheirDigits) {
    // A double of such a stamp is up to 128 ns off, a third of the interval.
    std::string text = "t,x\n", decimal = "t,x\n";
    for (std::int64_t i = 0; i < 200; ++i) {
        if (i == 70) continue;
        text += fmt::format("{},{}\n", 1403636579758555393 + 400 * i, i);
        decimal += fmt::format("1403636579.{:09},{}\n", 758555393 + 400 * i, i);
    }
    record::SeriesRequest asked{file(text), "x", "t", 2.5e6};
    asked.time_unit = "ns";
    const auto s = record::read_series(asked);
    EXPECT_EQ(s.n, 200u);
    EXPECT_EQ(s.missing, 1u);
    EXPECT_TRUE(std::isnan(s.values[70]));
    EXPECT_THAT(record::read_series(record::SeriesRequest{file(decimal), "x", "t", 2.5e6}).values,
                same_numbers(s.values));
}

TEST_F(AllanRecordTime, TheHeaderDeclaresTheUnit) {
    const auto text = [&](const std::string& header) { return file(header + "\n0,1\n5,2\n15,4\n", "declared.csv"); };
    for (const char* header : {"t [ms],x", "t (ms),x", "t_ms,x", "t [msec],x", "t,x\n(ms),(rad/s)", "t,x\nms,rad/s",
                               "#t [ms],x", "\"t [ms]\",\"x\""}) {
        const auto s = record::read_series(record::SeriesRequest{text(header), "x", "1", 200.0});
        EXPECT_THAT(s.values, same_numbers({1.0, 2.0, nan, 4.0})) << header;
    }
    record::SeriesRequest contradicted{text("t [ms],x"), "x", "t", 200.0};
    contradicted.time_unit = "us";
    EXPECT_THAT(error_of(contradicted),
                AllOf(HasSubstr("declared.csv:1:"), HasSubstr("in ms"), HasSubstr("contradicts --time-unit us")));
    contradicted.time_unit = "ms";
    EXPECT_EQ(error_of(contradicted), "no error");
}

TEST_F(AllanRecordTime, DatesAreTimes) {
    const auto read_dates = [&](const std::string& rows, const std::string& time = "t") {
        return record::read_series(record::SeriesRequest{file(rows, "dates.csv"), "x", time, 2.0}).values;
    };
    const std::vector<double> gap = {1.0, 2.0, nan, 4.0};
    EXPECT_THAT(read_dates("t,x\n2024-02-28T23:59:59.5Z,1\n2024-02-29T00:00:00Z,2\n2024-02-29T00:00:01.000Z,4\n"),
                same_numbers(gap));
    EXPECT_THAT(read_dates("t,x\n2023-12-31 23:59:59,1\n2023-12-31 23:59:59.500000,2\n2024-01-01 00:00:00.5,4\n"),
                same_numbers(gap));
    EXPECT_THAT(
        read_dates("t,x\n2024-05-01T12:00:00+02:00,1\n2024-05-01T10:00:00.5Z,2\n2024-05-01T05:00:01.5-0500,4\n"),
        same_numbers(gap));
    EXPECT_THAT(read_dates("t;x\n2024-05-01 12:00:00,0;1,0\n2024-05-01 12:00:00,5;2,0\n2024-05-01 12:00:01,5;4,0\n"),
                same_numbers(gap));
    EXPECT_THAT(read_dates("day clock x\n2024-05-01 12:00:00.0 1\n2024-05-01 12:00:00.5 2\n2024-05-01 12:00:01.5 4\n",
                           "day,clock"),
                same_numbers(gap));
    const auto refused = [&](const std::string& date) {
        return error_of(
            record::SeriesRequest{file("t,x\n2024-05-01T12:00:00,1\n" + date + ",2\n", "dates.csv"), "x", "t", 2.0});
    };
    for (const char* date : {"2024-13-01T00:00:00", "2024-02-30", "2024-05-01T12:61:00", "yesterday", "17",
                             "2024-05-01T12:00:00.5+2", "2024-05-01T12:00:00.5ZZ"}) {
        EXPECT_THAT(refused(date), AllOf(HasSubstr("dates.csv:3: column t"), HasSubstr(date), HasSubstr("not a date")));
    }
    EXPECT_THAT(refused("2024-05-01T11:00:00"), AllOf(HasSubstr("2024-05-01T11:00:00Z is before"), HasSubstr(":2:")));
}

TEST_F(AllanRecordTime, SecondsAndNanosecondsMayBeTwoColumns) {
    const auto stamps = file(
        "secs,nsecs,x\n1403636579,758555392,1\n1403636579,763555392,2\n1403636579,773555392,4\n"
        "1403636580,3555392,50\n",
        "two.csv");
    const auto s = record::read_series(record::SeriesRequest{stamps, "x", "secs,nsecs", 200.0});
    EXPECT_EQ(s.n, 50u);
    EXPECT_EQ(s.values[3], 4.0);
    EXPECT_EQ(s.values[49], 50.0);
    EXPECT_EQ(record::read_series(record::SeriesRequest{stamps, std::nullopt, "1,2", 200.0}).column, "x");
    EXPECT_THAT(error_of(record::SeriesRequest{stamps, "x", "secs,x y", 200.0}), HasSubstr("'x y'"));
    EXPECT_THAT(error_of(record::SeriesRequest{stamps, "x", "secs,1", 200.0}), HasSubstr("one column twice"));
    const auto wrong = file("secs,nsecs,x\n1,0,1\n1,1e9,2\n", "wrong.csv");
    EXPECT_THAT(error_of(record::SeriesRequest{wrong, "x", "secs,nsecs", 1.0}),
                AllOf(HasSubstr("wrong.csv:3: column nsecs"), HasSubstr("999999999")));
    const auto weeks = file("week,tow_s,x\n2190,345600,1\n2190,345600.005,2\n", "weeks.csv");
    EXPECT_THAT(
        error_of(record::SeriesRequest{weeks, "x", "week,tow_s", 200.0}),
        AllOf(HasSubstr("weeks.csv:1: column tow_s declares its times to be in s"), HasSubstr("name it alone")));
    // Fractions that a computation leaves are no fault.
    const auto rounded = file("secs,nsecs,x\n1,0.0000001,1\n1,5000000.1,2\n", "rounded.csv");
    EXPECT_EQ(record::read_series(record::SeriesRequest{rounded, "x", "secs,nsecs", 200.0}).n, 2U);
    EXPECT_EQ(record::read_series(record::SeriesRequest{weeks, "x", "tow_s", 200.0}).n, 2U);
}

}  // namespace
}  // namespace allan_record_time_test
