// Means and pairs of arms: Student's t is known in closed form for one and two degrees of freedom.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "analysis/lot/mean.hpp"
#include "analysis/lot/pairs.hpp"
#include "engine/core/error.hpp"
#include "engine/random/stream.hpp"
#include "tests/support/expect_throw.hpp"

namespace ringlock::lot {
namespace lot_means_pairs_test {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

double t_of_one(double level) { return std::tan(0.5 * std::numbers::pi * level); }
double t_of_two(double level) { return level * std::sqrt(2.0 / (1.0 - level * level)); }

random::NormalStream normals(std::uint64_t lot) {
    return random::NormalStream({4711, lot}, random::Purpose::initial_phase);
}

TEST(LotMean, HasStudentsInterval) {
    for (const double level : {0.5, 0.95, 0.99}) {
        const Mean two = mean(std::vector{1.0, 4.0}, {.level = level});
        EXPECT_NEAR(*two.value, 2.5, 1e-15);
        EXPECT_NEAR(*two.half_width, t_of_one(level) * 1.5, 1e-10);
        const Mean three = mean(std::vector{1.0, nan, 2.0, inf, 6.0}, {.level = level});
        EXPECT_EQ(three.n, 3);
        EXPECT_EQ(three.left_out, 2);
        const double sd = std::sqrt((4.0 + 1.0 + 9.0) / 2.0);
        EXPECT_NEAR(*three.standard_deviation, sd, 1e-14);
        EXPECT_NEAR(three.interval->lo, 3.0 - t_of_two(level) * sd / std::sqrt(3.0), 1e-11);
        EXPECT_NEAR(three.interval->hi, 3.0 + t_of_two(level) * sd / std::sqrt(3.0), 1e-11);
    }
    // Behind a stop: wider by sqrt(1.04 + 2/n), n = 2.
    const Mean stopped = mean(std::vector{1.0, 4.0}, {.level = 0.95, .sampling = Sampling::until_precise});
    EXPECT_NEAR(*stopped.half_width, t_of_one(0.95) * 1.5 * std::sqrt(2.04), 1e-10);
}

TEST(LotMean, OfDegenerateLots) {
    for (const std::vector<double>& none : {std::vector<double>{}, std::vector<double>{nan, inf, -inf}}) {
        const Mean m = mean(none);
        EXPECT_FALSE(m.value);
        EXPECT_FALSE(m.interval);
        EXPECT_EQ(m.n, 0);
        EXPECT_EQ(m.left_out, static_cast<std::int64_t>(none.size()));
    }
    const Mean one = mean(std::vector{5.0});
    EXPECT_EQ(*one.value, 5.0);
    EXPECT_FALSE(one.standard_deviation);
    EXPECT_FALSE(one.half_width);
    EXPECT_FALSE(one.interval);
    // 0.1 is no sum of powers of two: equal values must have no scatter all the same.
    const Mean equal = mean(std::vector<double>(1000, 0.1));
    EXPECT_EQ(*equal.value, 0.1);
    EXPECT_EQ(*equal.standard_deviation, 0.0);
    EXPECT_EQ(equal.interval->lo, 0.1);
    EXPECT_EQ(equal.interval->hi, 0.1);
    // Neither the sum nor a square of these is a number.
    const Mean large = mean(std::vector{1.7e308, 1.6e308, 1.5e308});
    EXPECT_NEAR(*large.value, 1.6e308, 1e293);
    EXPECT_NEAR(*large.standard_deviation, 1e307, 1e293);
    const Mean small = mean(std::vector{1e-300, 3e-300});
    EXPECT_NEAR(*small.value / 2e-300, 1.0, 1e-14);
    EXPECT_NEAR(*small.standard_deviation / (std::sqrt(2.0) * 1e-300), 1.0, 1e-14);
    EXPECT_THROW(mean(std::vector{1.0}, {.level = 1.5}), InputError);
}

TEST(LotMean, GeometricIsThatOfLogarithms) {
    const GeometricMean g = geometric_mean(std::vector{2.0, 8.0, 0.0, -1.0, nan, inf});
    EXPECT_NEAR(*g.value, 4.0, 1e-14);
    EXPECT_EQ(g.n, 2);
    EXPECT_EQ(g.left_out, 4);
    EXPECT_NEAR(*g.log_standard_deviation, std::numbers::ln2 * std::sqrt(2.0), 1e-14);
    const double half = t_of_one(0.95) * std::numbers::ln2;
    EXPECT_NEAR(std::log(g.interval->lo), std::log(4.0) - half, 1e-10);
    EXPECT_NEAR(std::log(g.interval->hi), std::log(4.0) + half, 1e-10);
    EXPECT_NEAR(*g.relative_half_width, g.interval->hi / *g.value - 1.0, 1e-9 * *g.relative_half_width);
    const GeometricMean none = geometric_mean(std::vector{-1.0, 0.0});
    EXPECT_FALSE(none.value);
    EXPECT_FALSE(none.interval);
    EXPECT_EQ(none.left_out, 2);
    EXPECT_FALSE(geometric_mean(std::vector{3.0}).relative_half_width);
}

TEST(LotPairs, TakeOutWhatGyrosShare) {
    // Gyros differ by factors; the arms by a ratio of 2 and 8, mean log ratio that of 4.
    const Comparison c = compare(std::vector{2e-3, 8.0, 1.0, 1.0}, std::vector{1e-3, 1.0, nan, 0.0});
    EXPECT_EQ(c.ratio.pairs, 2);
    EXPECT_EQ(c.ratio.left_out, 2);
    EXPECT_EQ(c.difference.pairs, 2);
    EXPECT_EQ(c.difference.left_out, 2);
    EXPECT_NEAR(*c.ratio.value, 4.0, 1e-14);
    EXPECT_NEAR(std::log(c.ratio.interval->hi / 4.0), t_of_one(0.95) * std::numbers::ln2, 1e-10);
    EXPECT_NEAR(*c.difference.value, 0.5 * (7.0 + 1e-3), 1e-14);
    EXPECT_NEAR(c.difference.interval->hi - *c.difference.value, t_of_one(0.95) * 0.5 * (7.0 - 1e-3), 1e-9);
    EXPECT_FALSE(c.ratio.distinguishable);
    EXPECT_FALSE(c.difference.distinguishable);
    // At a level of 0.3 t is 0.51, and both intervals exclude what equal arms have.
    const Comparison bold = compare(std::vector{2e-3, 8.0}, std::vector{1e-3, 1.0}, {.level = 0.3});
    EXPECT_TRUE(bold.ratio.distinguishable);
    EXPECT_TRUE(bold.difference.distinguishable);
}

TEST(LotPairs, SignedValuesHaveADifferenceButNoRatio) {
    const std::vector<double> a = {-1.0, 2.0, inf};
    const std::vector<double> b = {-2.0, 4.0, 1.0};
    const PairedFigure d = paired_difference(a, b);
    EXPECT_EQ(d.pairs, 2);
    EXPECT_EQ(d.left_out, 1);
    EXPECT_NEAR(*d.value, -0.5, 1e-15);
    EXPECT_NEAR(d.interval->hi + 0.5, t_of_one(0.95) * 1.5, 1e-10);
    const PairedFigure r = paired_ratio(a, b);
    EXPECT_EQ(r.pairs, 1);
    EXPECT_EQ(r.left_out, 2);
    EXPECT_NEAR(*r.value, 0.5, 1e-15);
    EXPECT_FALSE(r.interval) << "one pair tells of no scatter";
    EXPECT_FALSE(r.distinguishable);
}

TEST(LotPairs, OfNoPairs) {
    for (const std::vector<double>& a : {std::vector<double>{}, std::vector<double>{nan, 0.0}}) {
        const Comparison c = compare(a, std::vector<double>(a.size(), 1.0));
        EXPECT_FALSE(c.ratio.value);
        EXPECT_FALSE(c.ratio.interval);
        EXPECT_FALSE(c.difference.value);
        EXPECT_FALSE(c.difference.distinguishable);
        EXPECT_EQ(c.ratio.left_out, static_cast<std::int64_t>(a.size()));
    }
}

TEST(LotPairs, EqualArmsAreNotDistinguishable) {
    std::vector<double> a;
    random::NormalStream normal = normals(0);
    for (int i = 0; i < 50; ++i) a.push_back(1e-3 * std::exp(0.3 * normal()));
    const Comparison same = compare(a, a);
    EXPECT_EQ(*same.ratio.value, 1.0);
    EXPECT_EQ(same.ratio.interval->lo, 1.0);
    EXPECT_EQ(same.ratio.interval->hi, 1.0);
    EXPECT_EQ(*same.difference.value, 0.0);
    EXPECT_FALSE(same.ratio.distinguishable);
    EXPECT_FALSE(same.difference.distinguishable);
    // Equal but for the last digit, the same way in every gyro: that is rounding and no difference.
    std::vector<double> rounded = a;
    for (double& v : rounded) v = std::nextafter(v, inf);
    const Comparison near = compare(rounded, a);
    EXPECT_GT(near.ratio.interval->lo, 1.0);
    EXPECT_FALSE(near.ratio.distinguishable);
    EXPECT_FALSE(near.difference.distinguishable);
    // One ratio for all gyros has no scatter, and is another than 1.
    std::vector<double> doubled = a;
    for (double& v : doubled) v *= 2.0;
    const Comparison twice = compare(doubled, a);
    EXPECT_NEAR(*twice.ratio.value, 2.0, 1e-15);
    EXPECT_NEAR(twice.ratio.interval->lo, 2.0, 1e-14);
    EXPECT_TRUE(twice.ratio.distinguishable);
}

TEST(LotPairs, RatiosBeyondTheRangeOfNumbersHaveALogarithm) {
    const PairedFigure r = paired_ratio(std::vector{1e300, 1e-300}, std::vector{1e-300, 1e300});
    EXPECT_NEAR(*r.value, 1.0, 1e-12);
    EXPECT_EQ(r.pairs, 2);
}

TEST(LotPairs, FalseAlarmsAreAsRareAsTheLevelSays) {
    // 2000 lots of two equal arms of normal logarithms: 5 %, standard error 0.49 %; 4 of them allowed.
    constexpr int lots = 2000;
    int alarms = 0;
    for (int lot = 0; lot < lots; ++lot) {
        random::NormalStream normal = normals(static_cast<std::uint64_t>(lot));
        std::vector<double> a;
        std::vector<double> b;
        for (int i = 0; i < 16; ++i) {
            const double gyro = 0.5 * normal();
            a.push_back(std::exp(gyro + 0.05 * normal()));
            b.push_back(std::exp(gyro + 0.05 * normal()));
        }
        alarms += paired_ratio(a, b).distinguishable ? 1 : 0;
    }
    EXPECT_NEAR(alarms / static_cast<double>(lots), 0.05, 4.0 * std::sqrt(0.05 * 0.95 / lots));
}

TEST(LotPairs, MatrixComparesEveryArmWithEveryOther) {
    const std::vector<std::vector<double>> arms = {{1.0, 2.0, 3.0}, {2.0, 4.0, 6.5}, {nan, 1.0, 1.0}};
    const ComparisonMatrix m(arms);
    ASSERT_EQ(m.arms(), 3U);
    for (std::size_t a = 0; a < 3; ++a) {
        EXPECT_EQ(*m.at(a, a).ratio.value, 1.0);
        EXPECT_FALSE(m.at(a, a).ratio.distinguishable);
        for (std::size_t b = 0; b < 3; ++b) {
            const Comparison direct = compare(arms[a], arms[b]);
            EXPECT_NEAR(*m.at(a, b).ratio.value, *direct.ratio.value, 1e-14);
            EXPECT_NEAR(m.at(a, b).ratio.interval->lo, direct.ratio.interval->lo, 1e-12);
            EXPECT_NEAR(m.at(a, b).difference.interval->hi, direct.difference.interval->hi, 1e-12);
            EXPECT_EQ(m.at(a, b).ratio.distinguishable, direct.ratio.distinguishable);
            EXPECT_EQ(m.at(a, b).ratio.distinguishable, m.at(b, a).ratio.distinguishable);
            EXPECT_EQ(m.at(a, b).ratio.left_out, a == 2 || b == 2 ? 1 : 0);
        }
    }
    EXPECT_EQ(ComparisonMatrix(std::vector<std::vector<double>>{}).arms(), 0U);
    EXPECT_THROW(m.at(3, 0), InputError);
    const std::vector<std::vector<double>> uneven = {{1.0, 2.0}, {1.0}};
    EXPECT_THAT(test::message_of<InputError>([&] { ComparisonMatrix{uneven}; }), testing::HasSubstr("2 and 1 gyros"));
    EXPECT_THROW(paired_ratio(uneven[0], uneven[1]), InputError);
    EXPECT_THROW(paired_difference(uneven[0], uneven[1]), InputError);
    EXPECT_THROW(compare(uneven[0], uneven[0], {.level = nan}), InputError);
}

}  // namespace
}  // namespace lot_means_pairs_test
}  // namespace ringlock::lot
