// Values that repeat, pile up at an end of their range, or wrap.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "analysis/findings/values.hpp"

namespace findings_values_test {
namespace {

using namespace ringlock::findings;

std::vector<double> noise_of(std::size_t n, std::uint64_t seed, double step = 0.0) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    std::vector<double> values(n);
    for (double& v : values) {
        v = noise(random);
        if (step > 0.0) v = step * std::round(v / step);
    }
    return values;
}

// Fine steps and coarse ones, of which neighbours often have the same.
TEST(FoundValues, NothingInNoiseOfAnyStep) {
    for (const double step : {0.0, 0.01, 0.3, 1.0, 3.0}) {
        for (std::uint64_t seed = 1; seed <= 20; ++seed) {
            const std::vector<double> values = noise_of(2000, seed, step);
            EXPECT_TRUE(search_values(values).empty()) << step << " " << seed;
            EXPECT_FALSE(find_wraps(values)) << step << " " << seed;
        }
    }
}

TEST(FoundValues, AStuckOutputRepeats) {
    std::vector<double> values = noise_of(2000, 1, 0.01);
    std::fill_n(values.begin() + 700, 20, values[700]);
    const auto found = search_values(values);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].kind, Kind::repeated);
    EXPECT_EQ(found[0].row, 700U);
    EXPECT_GE(found[0].length, 20U);
    EXPECT_EQ(found[0].size, values[700]);
}

TEST(FoundValues, AClippedOutputPilesUp) {
    std::vector<double> values = noise_of(2000, 2);
    for (double& v : values) v = std::min(v, 1.5);
    const auto found = search_values(values);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].kind, Kind::clipped);
    EXPECT_EQ(found[0].size, 1.5);
    EXPECT_EQ(found[0].length, static_cast<std::size_t>(std::count(values.begin(), values.end(), 1.5)));
}

TEST(FoundValues, MissingValuesEndARun) {
    std::vector<double> values(200, std::numeric_limits<double>::quiet_NaN());
    const auto found = search_values(values);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].kind, Kind::gap);
    EXPECT_EQ(found[0].length, 200U);
    EXPECT_FALSE(find_wraps(values));
}

TEST(FoundValues, FewGapsAreAllGivenOfManyTheLongOnes) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    std::vector<double> values = noise_of(5000, 3);
    values[17] = nan;
    std::fill_n(values.begin() + 3000, 60, nan);
    auto found = search_values(values);
    ASSERT_EQ(found.size(), 2U);
    EXPECT_EQ(found[0].row, 17U);
    EXPECT_EQ(found[0].length, 1U);
    EXPECT_EQ(found[1].row, 3000U);
    EXPECT_EQ(found[1].length, 60U);
    std::mt19937_64 random(4);
    for (double& v : values) {
        if (random() % 3 == 0) v = nan;
    }
    values[2999] = values[3060] = 0.0;
    found = search_values(values);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].kind, Kind::gap);
    EXPECT_EQ(found[0].row, 3000U);
    EXPECT_EQ(found[0].length, 60U);
}

// Counters of 16 bits with and without a sign, angles in degrees: every wrap is undone.
TEST(FoundValues, WrapsAreUndone) {
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
        std::mt19937_64 random(seed);
        std::normal_distribution<double> noise;
        const double modulus = seed % 2 == 0 ? 65536.0 : 360.0;
        std::vector<double> truth;
        std::vector<double> values;
        double x = 0.0;
        for (int i = 0; i < 2000; ++i) {
            x += (seed % 3 == 0 ? -1.0 : 1.0) * modulus / 700.0 + modulus / 5000.0 * noise(random);
            if (modulus == 65536.0) x = std::round(x);
            truth.push_back(x);
            double v = x - modulus * std::floor(x / modulus);
            if (seed % 4 < 2 && v >= 0.5 * modulus) v -= modulus;
            values.push_back(v);
        }
        const auto wraps = find_wraps(values);
        ASSERT_TRUE(wraps) << seed;
        EXPECT_EQ(wraps->modulus, modulus) << seed;
        unwrap(*wraps, values);
        for (std::size_t i = 1; i < values.size(); ++i) {
            EXPECT_NEAR(values[i] - values[0], truth[i] - truth[0], 1e-6) << seed;
        }
    }
}

}  // namespace
}  // namespace findings_values_test
