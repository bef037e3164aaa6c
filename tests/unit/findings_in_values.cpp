// What values that repeat or are clipped do to the coefficients of a record.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "analysis/allan_run/run.hpp"
#include "analysis/allan_run/search_and_fit.hpp"
#include "analysis/findings/cleaned.hpp"
#include "analysis/findings/clipping.hpp"

namespace findings_in_values_test {
namespace {

using namespace ringlock;
using allan::Kind;

constexpr double truth_deg_rt_h = 1.0 / 60.0;  // of white noise of 1 arcsec/s at intervals of 1 s

std::vector<double> white(std::size_t n, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    std::vector<double> values(n);
    for (double& v : values) v = noise(random);
    return values;
}

allan_run::AllanOutput analysed(const std::vector<double>& values, Kind kind) {
    allan_run::AllanOutput out;
    out.tau0_s = 1.0;
    out.n = values.size();
    allan_run::search_and_fit(values, {}, allan::phase_of(values, kind, 1.0), kind, 1.0, out);
    return out;
}

bool holds(const noise::Coefficient& n) { return n.resolved && *n.lo <= truth_deg_rt_h && truth_deg_rt_h <= *n.hi; }

TEST(FindingsInValues, ShareClippedOffIsThatOfTheIntegral) {
    for (const double limit : {-1.0, 0.0, 0.5, 2.0, 3.0}) {
        double mean = 0.0;
        double square = 0.0;
        constexpr double step = 1e-3;
        for (double x = -9.0; x < 9.0; x += step) {
            const double weight = step * std::exp(-0.5 * x * x) / std::sqrt(2.0 * std::numbers::pi);
            mean += weight * std::min(x, limit);
            square += weight * std::min(x, limit) * std::min(x, limit);
        }
        EXPECT_NEAR(findings::share_clipped_off(limit), 1.0 - (square - mean * mean), 1e-6) << limit;
    }
    EXPECT_LT(findings::share_clipped_off(25.0), 1e-12);
}

// Noise that is clipped a little keeps its coefficients and they are right; clipped more, it has none.
TEST(FindingsInValues, ClippedNoiseHasRightCoefficientsOrNone) {
    constexpr int records = 30;
    const auto claimed_and_missed = [](double limit) {
        int claimed = 0;
        int missed = 0;
        for (int k = 0; k < records; ++k) {
            std::vector<double> values = white(2000, 700 + k);
            for (double& v : values) v = std::clamp(v, -limit, limit);
            const auto out = analysed(values, Kind::rate);
            if (!out.noise->described) {
                EXPECT_NE(out.noise->reason.find("ends of their range"), std::string::npos) << out.noise->reason;
                continue;
            }
            ++claimed;
            missed += holds(out.noise->arw_deg_rt_h) ? 0 : 1;
        }
        return std::pair{claimed, missed};
    };
    EXPECT_EQ(claimed_and_missed(2.0).first, 0);
    for (const double limit : {2.6, 3.0, 3.5}) {
        const auto [claimed, missed] = claimed_and_missed(limit);
        // 32 % of the intervals miss the truth; 15 of 30 are two standard errors above that.
        EXPECT_LE(missed, 15) << limit;
        if (limit > 3.2) {
            EXPECT_GE(claimed, 29);
        }
    }
}

TEST(FindingsInValues, SpikesThatSaturateAreNoClippedNoise) {
    std::vector<double> values = white(4000, 5);
    for (std::size_t i = 100; i < 4000; i += 390) values[i] = 40.0;
    const auto out = analysed(values, Kind::rate);
    EXPECT_TRUE(std::any_of(out.findings.begin(), out.findings.end(),
                            [](const findings::Finding& f) { return f.kind == findings::Kind::clipped; }));
    EXPECT_TRUE(out.noise->described) << out.noise->reason;
    EXPECT_NEAR(*out.noise->arw_deg_rt_h.value, truth_deg_rt_h, 0.04 * truth_deg_rt_h);
}

TEST(FindingsInValues, NoiseMostOfWhichIsClippedHasNoCoefficients) {
    std::vector<double> values = white(2000, 8);
    for (double& v : values) v = std::max(v, 0.8);
    const auto out = analysed(values, Kind::rate);
    EXPECT_FALSE(out.noise->described);
    EXPECT_EQ(out.noise->reason.find("nan"), std::string::npos) << out.noise->reason;
}

// An angle that is at the end of its range has no distribution to be compared with.
TEST(FindingsInValues, ClippedAnglesHaveNoCoefficients) {
    std::vector<double> angle = white(4000, 6);
    for (double& v : angle) v = std::clamp(v, -2.0, 2.0);
    const auto out = analysed(angle, Kind::phase);
    EXPECT_FALSE(out.noise->described);
    EXPECT_NE(out.noise->reason.find("ends of their range"), std::string::npos) << out.noise->reason;
}

TEST(FindingsInValues, WhatWasTakenOffIsSaidInWords) {
    EXPECT_EQ(findings::data_of({}), "all data");
    EXPECT_EQ(findings::data_of({.left_out = 0, .corrected = 1, .jumps = 0}), "the data without 1 outlier");
    EXPECT_EQ(findings::data_of({.left_out = 99, .corrected = 2, .jumps = 1}),
              "the data without 2 outliers, 1 jump and 99 data of disturbed stretches or of runs of one value");
    const std::vector<findings::Finding> found = {{.kind = findings::Kind::gap},
                                                  {.kind = findings::Kind::repeated},
                                                  {.kind = findings::Kind::jump},
                                                  {.kind = findings::Kind::clipped},
                                                  {.kind = findings::Kind::outlier}};
    EXPECT_EQ(findings::estimated_without(found), "outliers, jumps and repeated values");
    EXPECT_EQ(findings::estimated_without(std::span(found).first(1)), "");
    EXPECT_EQ(findings::listed(found), (std::vector<std::size_t>{1, 2, 3, 4, 0}));
}

class HeldValues : public testing::TestWithParam<Kind> {};

TEST_P(HeldValues, CountAsMissing) {
    const Kind kind = GetParam();
    int right = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        std::vector<double> values = white(1600, 40 + seed);
        if (kind == Kind::phase) {
            for (std::size_t i = 1; i < values.size(); ++i) values[i] += values[i - 1] + 2.0;
        }
        constexpr std::size_t length = 300;
        std::fill_n(values.begin() + 700, length, values[700]);
        const auto out = analysed(values, kind);
        ASSERT_TRUE(out.noise->described) << out.noise->reason;
        EXPECT_EQ(out.noise_filled_in, length - 1);
        EXPECT_EQ(out.noise_stretch, values.size() - (length - 1));
        right += holds(out.noise->arw_deg_rt_h) ? 1 : 0;
    }
    // As data they would make N too small by a tenth, which is five standard errors.
    EXPECT_GE(right, 2);
}

TEST_P(HeldValues, AtTheEndOfTheRecordCountAsMissing) {
    std::vector<double> values = white(1600, 60);
    if (GetParam() == Kind::phase) {
        for (std::size_t i = 1; i < values.size(); ++i) values[i] += values[i - 1] + 2.0;
    }
    std::fill(values.begin() + 1201, values.end(), values[1200]);
    const auto out = analysed(values, GetParam());
    ASSERT_TRUE(out.noise->described) << out.noise->reason;
    EXPECT_EQ(out.noise_stretch, 1201U);
    EXPECT_EQ(out.noise_filled_in, 399U);
    EXPECT_NEAR(*out.noise->arw_deg_rt_h.value, truth_deg_rt_h, 0.07 * truth_deg_rt_h);
}

// Where most of the record is one value, the rest is no record: it is not fitted by itself.
TEST_P(HeldValues, AreKeptWhereTheyAreMostOfTheRecord) {
    std::vector<double> values = white(1600, 61);
    std::fill(values.begin() + 400, values.end(), values[400]);
    const auto out = analysed(values, GetParam());
    EXPECT_FALSE(out.noise->described && out.noise->arw_deg_rt_h.resolved);
    EXPECT_FALSE(out.noise_filled_in);
}

INSTANTIATE_TEST_SUITE_P(Kinds, HeldValues, testing::Values(Kind::phase, Kind::increment, Kind::rate),
                         [](const auto& tested) { return std::string(allan_run::name_of(tested.param)); });

}  // namespace
}  // namespace findings_in_values_test
