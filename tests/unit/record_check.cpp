// What check() calls an error, a warning and nothing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "analysis/record/record.hpp"
#include "tests/unit/record_support.hpp"

namespace ringlock::record {
namespace record_check_test {
namespace {

using test::full_record;
using test::plain_samples;
using test::plain_turns;
using testing::AllOf;
using testing::HasSubstr;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

std::string text_of(const std::vector<Finding>& findings, Severity severity) {
    std::string text;
    for (const Finding& finding : findings) {
        if (finding.severity == severity) text += finding.where + ": " + finding.what + "\n";
    }
    return text;
}
std::string errors(const Record& record) { return text_of(check(record), Severity::error); }
std::string warnings(const Record& record) { return text_of(check(record), Severity::warning); }

Record of_turns(std::size_t rows, double noise_rad = 0.0) {
    Record record;
    record.turns = plain_turns(rows, noise_rad);
    return record;
}

TEST(RecordCheck, AcceptsWhatIsRight) {
    EXPECT_EQ(errors(full_record()) + warnings(full_record()), "");
    for (const std::size_t rows : {1U, 2U, 5U, 200U}) {
        EXPECT_EQ(errors(of_turns(rows)) + warnings(of_turns(rows)), "") << rows;
    }
    for (const SampleKind kind :
         {SampleKind::angle_increment_arcsec, SampleKind::angle_arcsec, SampleKind::quarter_count}) {
        Record record;
        record.samples = plain_samples(1000, kind);
        EXPECT_EQ(errors(record) + warnings(record), "");
    }
}

TEST(RecordCheck, NamesEveryFaultWithItsPlace) {
    struct Fault {
        std::function<void(Record&)> damage;
        std::vector<std::string> said;
    };
    const std::vector<Fault> faults = {
        {[](Record& r) { r.turns.reset(), r.samples.reset(); }, {"neither turns nor samples"}},
        {[](Record& r) { r.turns = Turns{}; }, {"/turns", "no rows"}},
        {[](Record& r) { r.turns->sine.pop_back(); }, {"/turns/sin", "49 rows", "50"}},
        {[](Record& r) { r.turns->cosine.push_back(1.0); }, {"/turns/cos", "51 rows"}},
        {[](Record& r) { r.turns->direction.pop_back(); }, {"/turns/direction", "49 rows"}},
        {[](Record& r) { r.turns->quarter_count.clear(); }, {"/turns/quarter_count", "0 rows"}},
        {[](Record& r) { r.turns->accel_before_rad_s2.pop_back(); }, {"/turns/accel_before_rad_s2", "49 rows"}},
        {[](Record& r) { r.turns->accel_after_rad_s2.pop_back(); }, {"/turns/accel_after_rad_s2", "49 rows"}},
        {[](Record& r) { r.turns->time_s[7] = nan; }, {"/turns/time_s, row 7", "nan", "finite"}},
        {[](Record& r) { r.turns->sine[9] = infinity; }, {"/turns/sin, row 9", "inf"}},
        {[](Record& r) { r.turns->cosine[8] = -1e160; },
         {"/turns/cos, row 8", "is -1e+160", "no reading can be beyond 1e+15"}},
        {[](Record& r) { r.turns->cosine[9] = r.turns->cosine[30] = -infinity; },
         {"/turns/cos, row 9", "-inf", "2 such rows"}},
        {[](Record& r) { std::swap(r.turns->time_s[4], r.turns->time_s[5]); },
         {"/turns/time_s, row 5", "must increase"}},
        {[](Record& r) { r.turns->time_s[5] = r.turns->time_s[4]; }, {"/turns/time_s, row 5", "must increase"}},
        {[](Record& r) { r.turns->direction[6] = 0; }, {"/turns/direction, row 6", "is 0", "+1"}},
        {[](Record& r) { r.turns->direction[6] = 3; }, {"/turns/direction, row 6", "is 3"}},
        {[](Record& r) { r.turns->direction[6] = -1; }, {"/turns/direction, row 6", "alternate"}},
        {[](Record& r) {
             for (std::size_t i = 20; i < 50; ++i) r.turns->quarter_count[i] += 200;
         },
         {"/turns/quarter_count, row 20", "jumps"}},
        {[](Record& r) { r.turns->quarter_count[20] -= 300; },
         {"/turns/quarter_count, row 20", "jumps", "2 such rows"}},
        {[](Record& r) { r.turns->quarter_count[20] = std::numeric_limits<std::int64_t>::min(); },
         {"/turns/quarter_count, row 20", "no counter"}},
        {[](Record& r) {
             for (auto& count : r.turns->quarter_count) count = -count;
         },
         {"/turns/quarter_count", "wrong sign"}},
        {[](Record& r) { r.turns->sine[8] = r.turns->cosine[8] = 0.0; }, {"/turns/sin and cos, row 8", "radius 0"}},
        {[](Record& r) { r.turns->accel_before_rad_s2[2] = -1.0; }, {"/turns/accel_before_rad_s2, row 2", "magnitude"}},
        {[](Record& r) { r.turns->accel_after_rad_s2[2] = nan; }, {"/turns/accel_after_rad_s2, row 2", "finite"}},
        {[](Record& r) {
             for (std::size_t i = 20; i < 50; ++i) r.turns->time_s[i] += 0.008;
         },
         {"/turns/time_s, row 20", "0.012 s after", "0.004 s"}},
        {[](Record& r) { r.turns->time_s[20] = r.turns->time_s[19] + 1e-5; }, {"/turns/time_s, row 20", "1e-05 s"}},
        {[](Record& r) { r.samples->rate_hz = 0.0; }, {"/samples, attribute rate_hz", "is 0"}},
        {[](Record& r) { r.samples->rate_hz = -5.0; }, {"/samples, attribute rate_hz", "is -5"}},
        {[](Record& r) { r.samples->rate_hz = nan; }, {"/samples, attribute rate_hz", "nan"}},
        {[](Record& r) { r.samples->t0_s = infinity; }, {"/samples, attribute t0_s"}},
        {[](Record& r) { r.samples->values[3] = infinity; }, {"/samples/angle_increment_arcsec, row 3", "inf"}},
        {[](Record& r) { std::fill_n(r.samples->values.begin() + 3, 21, nan); },
         {"/samples/angle_increment_arcsec, row 3", "21 of 40 samples are missing", "at least half"}},
        {[](Record& r) { r.samples->values.assign(40, nan); },
         {"/samples/angle_increment_arcsec, row 0", "40 of 40 samples are missing"}},
        {[](Record& r) { r.samples->values.clear(); }, {"/samples/angle_increment_arcsec", "no rows"}},
        {[](Record& r) { r.samples->counts.push_back(1); },
         {"/samples", "counts in addition to angle_increment_arcsec"}},
        {[](Record& r) { r.samples->witnesses["accel_x"].pop_back(); }, {"/samples/accel_x", "39 rows", "40"}},
        {[](Record& r) { r.samples->witnesses["accel_y"][5] = infinity; }, {"/samples/accel_y, row 5"}},
        {[](Record& r) { r.temperature_c.value.pop_back(); }, {"/environment/temperature_c", "2 rows", "3"}},
        {[](Record& r) { r.temperature_c.time_s[1] = 2.0; }, {"/environment/time_s, row 2", "must increase"}},
        {[](Record& r) { r.temperature_c.value[0] = nan; }, {"/environment/temperature_c, row 0"}},
        {[](Record& r) { r.input_rate_deg_h.time_s[0] = -infinity; }, {"/reference/time_s, row 0"}},
        {[](Record& r) { std::swap(r.input_rate_deg_h.time_s[0], r.input_rate_deg_h.time_s[1]); },
         {"/reference/time_s, row 1", "must increase"}},
        {[](Record& r) { r.declared.scale_factor_arcsec = 0.0; },
         {"/declared, attribute scale_factor_arcsec", "positive"}},
        {[](Record& r) { r.declared.lockin_threshold_deg_h = -1.0; }, {"lockin_threshold_deg_h", "not negative"}},
        {[](Record& r) { r.declared.bias_deg_h = nan; }, {"bias_deg_h", "nan"}},
    };
    for (std::size_t i = 0; i < faults.size(); ++i) {
        Record record = full_record();
        faults[i].damage(record);
        for (const std::string& said : faults[i].said) EXPECT_THAT(errors(record), HasSubstr(said)) << "fault " << i;
    }
}

TEST(RecordCheck, WarnsOfWhatMayBeSo) {
    Record record = full_record();
    record.samples->values.assign(40, 0.25);
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record), AllOf(HasSubstr("/samples/angle_increment_arcsec"), HasSubstr("in every row")));

    record = full_record();
    record.samples->values[11] = record.samples->values[12] = record.samples->values[20] = nan;
    record.samples->witnesses["accel_x"][7] = nan;
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record),
                AllOf(HasSubstr("angle_increment_arcsec, row 11 (counted from 0): 3 of 40 samples are missing"),
                      HasSubstr("in 2 stretches"), HasSubstr("accel_x, row 7"), testing::Not(HasSubstr("glitch"))));
    record.samples->values[13] = 1e6;
    EXPECT_THAT(warnings(record), AllOf(HasSubstr("row 13"), HasSubstr("glitch")));

    record = full_record();
    record.samples->values[11] = 1e6;
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record), AllOf(HasSubstr("angle_increment_arcsec, row 11"), HasSubstr("glitch")));

    record = full_record();
    record.samples->witnesses["pressure"].assign(40, 1.0);
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record), HasSubstr("/samples/pressure"));

    record = full_record();
    record.temperature_c = {{0.3, 0.4}, {20.0, 21.0}};
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record),
                AllOf(HasSubstr("/environment/time_s"), HasSubstr("the turns"), HasSubstr("samples")));

    record = full_record();
    record.declared.dither_frequency_hz = 400.0;
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record), AllOf(HasSubstr("400"), HasSubstr("125")));

    record = full_record();
    record.turns->sine.assign(50, 0.5);
    record.turns->cosine.assign(50, 0.5);
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record), HasSubstr("detectors connected"));

    record = full_record();
    record.ignored = {"/turns/note"};
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record), HasSubstr("/turns/note"));
}

// What honest instruments do: noise on the dither, counts missed now and then, amplitudes that wander and drift, rates
// that step, an asymmetric dither. None of it is a jump.
TEST(RecordCheck, HonestRecordsHaveNoJumps) {
    for (const double noise_rad : {0.0, 0.3, 3.0, 30.0}) EXPECT_EQ(errors(of_turns(20000, noise_rad)), "") << noise_rad;

    Record record = of_turns(20000, 3.0);
    std::mt19937_64 engine(3);
    std::int64_t missed = 0;
    double amplitude = 0.0;
    std::normal_distribution<double> normal;
    for (std::size_t i = 0; i < record.turns->size(); ++i) {
        if (engine() % 50 == 0) missed += static_cast<std::int64_t>(engine() % 9) - 4;
        amplitude += 0.5 * normal(engine) + 0.002;  // quarter fringes, at maxima alone
        const std::int64_t added = missed + (i % 2 == 1 ? static_cast<std::int64_t>(amplitude) : 0);
        record.turns->quarter_count[i] += added;
    }
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record), HasSubstr("counts may have been missed"));

    record = of_turns(2000, 1.0);
    for (std::size_t i = 0; i < 2000; ++i) {
        // A rate that is on for some time, and half cycles of one and three milliseconds' difference.
        if (i > 700)
            record.turns->quarter_count[i] += 60 * static_cast<std::int64_t>(std::min<std::size_t>(i, 1400) - 700);
        if (i % 2 == 1) record.turns->time_s[i] += 0.0015;
    }
    EXPECT_EQ(errors(record), "");
}

TEST(RecordCheck, MissedCountsAreAWarningOnly) {
    Record record = of_turns(400);
    for (std::size_t i = 100; i < 400; ++i) record.turns->quarter_count[i] += 1;
    EXPECT_EQ(errors(record), "");
    EXPECT_THAT(warnings(record), AllOf(HasSubstr("/turns/quarter_count"), HasSubstr("missed")));
    // A counter that starts anywhere is none.
    record = of_turns(400);
    for (auto& count : record.turns->quarter_count) count += 1'000'003;
    EXPECT_EQ(errors(record) + warnings(record), "");
}

/// Detectors that read this of the phase.
Record of_detectors(std::size_t rows, double (*sine)(double, double), double (*cosine)(double, double)) {
    Record record = of_turns(rows);
    for (std::size_t i = 0; i < rows; ++i) {
        const double s = record.turns->sine[i];
        const double c = record.turns->cosine[i];
        record.turns->sine[i] = sine(s, c);
        record.turns->cosine[i] = cosine(s, c);
    }
    return record;
}

TEST(RecordCheck, DetectorsThatTurnTheOtherWayAreAFault) {
    const auto s = [](double sine, double) { return sine; };
    const auto c = [](double, double cosine) { return cosine; };
    const auto minus_s = [](double sine, double) { return -sine; };
    const auto minus_c = [](double, double cosine) { return -cosine; };
    EXPECT_THAT(errors(of_detectors(400, c, s)), HasSubstr("sin and cos are swapped"));
    EXPECT_THAT(errors(of_detectors(400, s, minus_c)), HasSubstr("the wrong sign"));
    EXPECT_THAT(errors(of_detectors(400, minus_s, c)), HasSubstr("the wrong sign"));
    // Both together only count from another quarter, as any counter may.
    EXPECT_EQ(errors(of_detectors(400, minus_s, minus_c)), "");
    EXPECT_EQ(errors(of_detectors(400, c, minus_s)), "");
    EXPECT_EQ(errors(of_detectors(400, s, c)), "");
}

TEST(RecordCheck, FringesInPlaceOfQuartersAreAFault) {
    Record record = of_turns(400);
    for (auto& count : record.turns->quarter_count) count = count >= 0 ? count / 4 : (count - 3) / 4;
    EXPECT_THAT(errors(record), AllOf(HasSubstr("/turns/quarter_count"), HasSubstr("four to a fringe")));
    // One that loses pulses by the hundred is an effect.
    record = of_turns(400);
    for (auto& count : record.turns->quarter_count) count = static_cast<std::int64_t>(0.8 * static_cast<double>(count));
    EXPECT_EQ(errors(record), "");
}

TEST(RecordTrack, IsLinearBetweenItsRowsAndConstantBeyond) {
    const Track track{{1.0, 2.0, 4.0}, {10.0, 20.0, 0.0}};
    EXPECT_EQ(track.at(-5.0), 10.0);
    EXPECT_EQ(track.at(1.0), 10.0);
    EXPECT_EQ(track.at(1.25), 12.5);
    EXPECT_EQ(track.at(2.0), 20.0);
    EXPECT_EQ(track.at(3.0), 10.0);
    EXPECT_EQ(track.at(4.0), 0.0);
    EXPECT_EQ(track.at(9.0), 0.0);
    EXPECT_EQ((Track{{3.0}, {7.0}}).at(100.0), 7.0);
    EXPECT_TRUE(Track{}.empty());
}

}  // namespace
}  // namespace record_check_test
}  // namespace ringlock::record
