// Records with missing samples: filled in for the filter, and counted by no fit and no test.
#include "analysis/closure/samples/model/gaps.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/record/record.hpp"
#include "engine/core/error.hpp"
#include "tests/closure/generator/samples.hpp"

namespace samples_gaps_test {
namespace {

using namespace ringlock;
using namespace ringlock::test::closure;

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

record::Record usual(std::uint64_t seed, std::size_t size = 10000) {
    SampleTruth truth;
    truth.seed = seed;
    truth.size = size;
    truth.white_angle_arcsec = 0.3;
    truth.rates.quantum_noise_deg_rt_h = 0.01;
    truth.mean_rate_deg_h = 10.0;
    return generate_samples(truth);
}

void lose(record::Record& record, std::size_t from, std::size_t count) {
    std::fill_n(record.samples->values.begin() + static_cast<std::ptrdiff_t>(from), count, nan_value);
}

/// Some gaps of 1 to 200 samples at random places.
void lose_at_random(record::Record& record, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const std::size_t n = record.samples->size();
    for (int gap = 0; gap < 6; ++gap) lose(record, random() % (n - 200), 1 + random() % 200);
}

TEST(SampleGaps, AreBridgedByLinesAndFilledWithMeans) {
    std::vector<double> angle = {nan_value, 1.0, nan_value, nan_value, 4.0, nan_value};
    EXPECT_EQ(closure::bridge_gaps(angle), 4u);
    EXPECT_THAT(angle, testing::ElementsAre(1.0, 1.0, 2.0, 3.0, 4.0, 4.0));
    std::vector<double> increments = {1.0, nan_value, 3.0, 5.0, nan_value};
    EXPECT_EQ(closure::fill_gaps(increments), 2u);
    EXPECT_THAT(increments, testing::ElementsAre(1.0, 3.0, 3.0, 5.0, 3.0));
}

TEST(SampleGaps, FewerRowsBehindManyGapsAreLeftOut) {
    closure::Rows one(1000, 0);
    one[500] = 1;
    const closure::Rows behind = closure::rows_about_gaps(one);
    EXPECT_EQ(std::count(behind.begin(), behind.end(), 1), 21);
    EXPECT_EQ(behind[499], 0);
    closure::Rows many(1000, 0);
    for (std::size_t i = 0; i < many.size(); i += 8) many[i] = 1;
    const closure::Rows kept = closure::rows_about_gaps(many);
    EXPECT_LE(std::count(kept.begin(), kept.end(), 1), 500);
    for (std::size_t i = 0; i < many.size(); ++i) EXPECT_GE(kept[i], many[i]);
}

// Of increments the rotation in a gap is lost; of angles it is known, and the next one is not off by it.
TEST(SampleGaps, AnglesKeepTheRotationThatWasMissed) {
    record::Record record = usual(1, 2000);
    std::vector<double> angle = {0.0};
    for (const double step : record.samples->values) angle.push_back(angle.back() + step);
    record::Record of_angles = record;
    of_angles.samples->kind = record::SampleKind::angle_arcsec;
    of_angles.samples->values = angle;
    lose(of_angles, 700, 50);
    const closure::SampleSeries series = closure::prepare_samples(of_angles);
    ASSERT_EQ(series.missing.size(), series.size());
    // 50 angles are in 51 increments.
    EXPECT_EQ(std::count(series.missing.begin(), series.missing.end(), 1), 51);
    double sum = 0.0;
    for (const double step : series.increment) sum += step;
    EXPECT_NEAR(sum, angle.back(), 1e-9);
}

TEST(SampleGaps, AreNoMissingEffect) {
    int wrong = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        record::Record record = usual(seed);
        lose_at_random(record, seed);
        const closure::Closure found = closure::close_loop(record);
        EXPECT_GE(found.gaps.size(), 3u);
        wrong += found.verdict != closure::Verdict::nothing_missing;
        for (const closure::Estimate& e : found.base) {
            if (e.name != "mean_rate_deg_h") continue;
            EXPECT_NEAR(e.value, 10.0, 5.0 * e.sd);
        }
    }
    EXPECT_EQ(wrong, 0);
}

// The filter between the gaps is that of a record without any: the estimates are those of the whole record.
TEST(SampleGaps, AnEffectIsFoundAroundThem) {
    SampleTruth truth;
    truth.seed = 5;
    truth.size = 10000;
    truth.white_angle_arcsec = 0.3;
    truth.rates.quantum_noise_deg_rt_h = 0.01;
    truth.dither_residue.frequency_hz = 37.3;
    truth.dither_residue.amplitude_arcsec = 0.2;
    record::Record record = generate_samples(truth);
    lose_at_random(record, 3);
    const closure::Closure found = closure::close_loop(record);
    ASSERT_EQ(found.steps.size(), 1u);
    EXPECT_EQ(found.verdict, closure::Verdict::closed);
    for (const closure::Estimate& e : found.steps[0].parameters) {
        if (e.name != "amplitude_arcsec") continue;
        EXPECT_NEAR(e.value, 0.2, 5.0 * e.sd);
    }
}

/// The same samples as angles since the start.
record::Record as_angles(record::Record record) {
    double sum = 0.0;
    for (double& value : record.samples->values) value = sum += value;
    record.samples->kind = record::SampleKind::angle_arcsec;
    return record;
}

// Gaps of all kinds in increments and angles. Of 120 at 0.3 % a third of one is expected; more than three have a
// probability of 6e-4.
TEST(LongSampleGaps, FalseAlarmsAreAsRareAsWithoutThem) {
    int alarms = 0;
    for (std::uint64_t seed = 1; seed <= 120; ++seed) {
        record::Record record = seed % 2 == 0 ? as_angles(usual(100 + seed)) : usual(100 + seed);
        if (seed % 4 < 2) {
            lose_at_random(record, seed);
        } else {
            std::mt19937_64 random(seed);
            for (double& value : record.samples->values) {
                if (random() % 100 < 3) value = nan_value;
            }
        }
        const closure::Closure found = closure::close_loop(record);
        if (found.verdict == closure::Verdict::nothing_missing) continue;
        ++alarms;
        std::printf("seed %llu: %zu steps %s\n", static_cast<unsigned long long>(seed), found.steps.size(),
                    found.unexplained ? found.unexplained->description().c_str() : "");
    }
    EXPECT_LE(alarms, 3);
}

TEST(SampleGaps, MoreThanHalfMissingIsAnError) {
    record::Record record = usual(1, 2000);
    lose(record, 100, 1200);
    EXPECT_THROW(closure::close_loop(record), InputError);
}

}  // namespace
}  // namespace samples_gaps_test
