// Shares and quantiles of a lot, against published values, the equations that define them, and sums over binomial
// probabilities.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "analysis/lot/quantile.hpp"
#include "analysis/lot/share.hpp"
#include "engine/core/error.hpp"
#include "tests/support/expect_throw.hpp"

namespace ringlock::lot {
namespace lot_share_quantile_test {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

/// P(B = k) of n trials by multiplication, without any function of the library that the code under test uses.
std::vector<double> binomial(int n, double p) {
    std::vector<double> b = {1.0};
    for (int i = 0; i < n; ++i) {
        b.push_back(0.0);
        for (std::size_t k = b.size() - 1; k > 0; --k) b[k] = b[k] * (1.0 - p) + b[k - 1] * p;
        b[0] *= 1.0 - p;
    }
    return b;
}

/// P(from <= B <= to).
double between(const std::vector<double>& b, std::int64_t from, std::int64_t to) {
    double sum = 0.0;
    for (std::int64_t k = from; k <= to; ++k) sum += b[static_cast<std::size_t>(k)];
    return sum;
}

TEST(LotShare, EqualsPublishedIntervals) {
    // R. G. Newcombe, Statistics in Medicine 17, 857 (1998), Table I, method 5 (Clopper-Pearson), four digits.
    struct Published {
        int k, n;
        double lo, hi;
    };
    for (const Published& p : {Published{81, 263, 0.2527, 0.3676}, Published{15, 148, 0.0578, 0.1617},
                               Published{0, 20, 0.0, 0.1684}, Published{1, 29, 0.0009, 0.1776}}) {
        const Share s = share(p.k, p.n);
        ASSERT_TRUE(s.interval);
        EXPECT_NEAR(s.interval->lo, p.lo, 0.5e-4) << p.k << " of " << p.n;
        EXPECT_NEAR(s.interval->hi, p.hi, 0.5e-4) << p.k << " of " << p.n;
        EXPECT_DOUBLE_EQ(*s.value, static_cast<double>(p.k) / p.n);
        EXPECT_DOUBLE_EQ(*s.half_width(), 0.5 * (s.interval->hi - s.interval->lo));
    }
}

TEST(LotShare, OfNoneOrAllIsClosedForm) {
    for (const int n : {1, 2, 16, 1000, 1000000}) {
        for (const double level : {0.5, 0.95, 0.999}) {
            const double reach = std::pow(0.5 * (1.0 - level), 1.0 / n);
            const Share none = share(0, n, {.level = level});
            EXPECT_EQ(none.interval->lo, 0.0);
            EXPECT_NEAR(none.interval->hi, 1.0 - reach, 1e-12) << n;
            const Share all = share(n, n, {.level = level});
            EXPECT_NEAR(all.interval->lo, reach, 1e-12) << n;
            EXPECT_EQ(all.interval->hi, 1.0);
        }
    }
}

TEST(LotShare, EndsSolveTheirTails) {
    for (const int n : {3, 16, 72, 200}) {
        for (const Sampling sampling : {Sampling::fixed, Sampling::until_precise}) {
            const Confidence confidence{.level = 0.9, .sampling = sampling};
            const double tail = sampling == Sampling::fixed ? 0.05 : 0.05 * 2.0 / 3.0;
            for (int k = 1; k < n; k += 1 + n / 7) {
                const Interval i = *share(k, n, confidence).interval;
                EXPECT_NEAR(between(binomial(n, i.lo), k, n), tail, 1e-10) << k << " of " << n;
                EXPECT_NEAR(between(binomial(n, i.hi), 0, k), tail, 1e-10) << k << " of " << n;
            }
        }
    }
}

TEST(LotShare, HoldsTheTruthAsOftenAsItSays) {
    for (const int n : {1, 2, 7, 16, 40}) {
        std::vector<Interval> intervals;
        for (int k = 0; k <= n; ++k) intervals.push_back(*share(k, n).interval);
        for (int i = 1; i < 400; ++i) {
            const double p = i / 400.0;
            const auto b = binomial(n, p);
            double above = 0.0;
            double below = 0.0;
            for (std::size_t k = 0; k < intervals.size(); ++k) {
                if (intervals[k].lo > p) above += b[k];
                if (intervals[k].hi < p) below += b[k];
            }
            EXPECT_LE(above, 0.025 + 1e-12) << n << ' ' << p;
            EXPECT_LE(below, 0.025 + 1e-12) << n << ' ' << p;
        }
    }
}

TEST(LotShare, OfNoGyrosIsAbsent) {
    const Share s = share(0, 0);
    EXPECT_FALSE(s.value);
    EXPECT_FALSE(s.interval);
    EXPECT_FALSE(s.half_width());
}

TEST(LotShare, RefusesWhatIsNoShare) {
    EXPECT_THAT(test::message_of<InputError>([] { share(3, 2); }), testing::HasSubstr("3 of 2 gyros"));
    EXPECT_THROW(share(-1, 2), InputError);
    EXPECT_THROW(share(0, -1), InputError);
    for (const double level : {0.0, 1.0, -0.5, 95.0, nan}) EXPECT_THROW(share(1, 2, {.level = level}), InputError);
}

TEST(LotQuantile, RanksAreTheTightestThatTheirTailsAllow) {
    for (const int n : {1, 5, 16, 64, 71, 72, 128, 333}) {
        for (const double p : {0.01, 0.05, 0.3, 0.5, 0.841, 0.95}) {
            for (const double level : {0.95, 0.7}) {
                const double tail = 0.5 * (1.0 - level);
                const auto b = binomial(n, p);
                const QuantileRanks r = quantile_ranks(n, p, {.level = level});
                const std::int64_t lo = r.lo.value_or(0);
                if (lo > 0) {
                    EXPECT_LE(between(b, 0, lo - 1), tail) << n << ' ' << p;
                }
                EXPECT_GT(between(b, 0, lo), tail) << n << ' ' << p;
                const std::int64_t hi = r.hi.value_or(n + 1);
                if (hi <= n) {
                    EXPECT_LE(between(b, hi, n), tail) << n << ' ' << p;
                }
                EXPECT_GT(between(b, hi - 1, n), tail) << n << ' ' << p;
            }
        }
    }
    // Tables of the sign test: the 95 % interval of the median of 20 runs from the 6th to the 15th value.
    const QuantileRanks median = quantile_ranks(20, 0.5);
    EXPECT_EQ(median.lo, 6);
    EXPECT_EQ(median.hi, 15);
}

TEST(LotQuantile, OfFivePercentWantsSeventyTwoGyros) {
    EXPECT_EQ(std::ceil(std::log(0.025) / std::log(0.95)), 72.0);
    EXPECT_FALSE(quantile_ranks(71, 0.05).lo);
    EXPECT_TRUE(quantile_ranks(71, 0.05).hi);
    EXPECT_EQ(quantile_ranks(72, 0.05).lo, 1);
    EXPECT_FALSE(quantile_ranks(71, 0.95).hi);
    EXPECT_EQ(quantile_ranks(72, 0.95).hi, 72);
    // Behind a stop each end may miss by two thirds of 0.025.
    EXPECT_EQ(std::ceil(std::log(0.025 * 2.0 / 3.0) / std::log(0.95)), 80.0);
    const Confidence stopped{.level = 0.95, .sampling = Sampling::until_precise};
    EXPECT_FALSE(quantile_ranks(79, 0.05, stopped).lo);
    EXPECT_EQ(quantile_ranks(80, 0.05, stopped).lo, 1);
}

TEST(LotQuantile, EstimateIsDefinitionEight) {
    // Positions (n + 1/3) p + 1/3 in 1, 4, 9, ... 100, by hand: p = 0.25 at 2.91667, 0.5 at 5.5, 0.9 at 9.63333.
    std::vector<double> squares;
    for (int i = 10; i >= 1; --i) squares.push_back(i * i);
    const auto q = quantiles(squares, std::vector{0.25, 0.5, 0.9, 0.001, 0.999});
    EXPECT_NEAR(*q[0].value, 4.0 + (11.0 / 12.0) * 5.0, 1e-12);
    EXPECT_NEAR(*q[1].value, 30.5, 1e-12);
    EXPECT_NEAR(*q[2].value, 81.0 + (19.0 / 30.0) * 19.0, 1e-12);
    EXPECT_EQ(*q[3].value, 1.0);
    EXPECT_EQ(*q[4].value, 100.0);
    EXPECT_EQ(*q[1].lo, 4.0) << "the second value";
    EXPECT_EQ(*q[1].hi, 81.0) << "the ninth";
    EXPECT_FALSE(q[0].lo) << "0.75^10 is more than 0.025";
    EXPECT_EQ(q[0].n, 10);
    EXPECT_EQ(q[0].missing, 0);
}

TEST(LotQuantile, CountsGyrosWithoutAValue) {
    std::vector<double> values = {nan, 3.0, nan, 1.0, 2.0, nan};
    const auto q = quantiles(values, std::vector{0.5});
    EXPECT_EQ(*q[0].value, 2.0);
    EXPECT_EQ(q[0].n, 3);
    EXPECT_EQ(q[0].missing, 3);
    // 71 values and one missing do not bound 5 % as 72 would.
    std::vector<double> many(72);
    for (std::size_t i = 0; i < many.size(); ++i) many[i] = static_cast<double>(i);
    EXPECT_TRUE(quantiles(many, std::vector{0.05})[0].lo);
    many[40] = nan;
    EXPECT_FALSE(quantiles(many, std::vector{0.05})[0].lo);
}

TEST(LotQuantile, OfDegenerateLots) {
    const std::vector<double> p = {0.05, 0.5};
    for (const std::vector<double>& none : {std::vector<double>{}, std::vector<double>{nan, nan}}) {
        const auto q = quantiles(none, p);
        ASSERT_EQ(q.size(), 2U);
        EXPECT_FALSE(q[1].value);
        EXPECT_FALSE(q[1].lo);
        EXPECT_FALSE(q[1].hi);
        EXPECT_EQ(q[1].n, 0);
        EXPECT_EQ(q[1].missing, static_cast<std::int64_t>(none.size()));
    }
    const auto one = quantiles(std::vector{7.0}, p);
    EXPECT_EQ(*one[0].value, 7.0);
    EXPECT_FALSE(one[1].lo);
    EXPECT_FALSE(one[1].hi);
    const auto equal = quantiles(std::vector<double>(100, 0.1), p);
    EXPECT_EQ(*equal[0].value, 0.1);
    EXPECT_EQ(*equal[0].lo, 0.1);
    EXPECT_EQ(*equal[1].hi, 0.1);
    // A gyro without bound is a value: worse than all others.
    EXPECT_EQ(*quantiles(std::vector{inf, 1.0, 2.0}, p)[1].value, 2.0);
    EXPECT_EQ(*quantiles(std::vector{inf, 1.0, inf, 2.0}, p)[1].value, inf);
    EXPECT_EQ(*quantiles(std::vector{-inf, 1.0}, p)[1].value, -inf);
    EXPECT_FALSE(quantiles(std::vector{-inf, inf}, p)[1].value);
    EXPECT_TRUE(quantiles(std::vector{1.0}, std::vector<double>{}).empty());
    for (const double wrong : {0.0, 1.0, -0.1, 5.0, nan}) {
        EXPECT_THROW(quantiles(std::vector{1.0}, std::vector{wrong}), InputError);
        EXPECT_THROW(quantile_ranks(10, wrong), InputError);
    }
    EXPECT_THROW(quantile_ranks(-1, 0.5), InputError);
    EXPECT_THROW(quantiles(std::vector{1.0}, std::vector{0.5}, {.level = 1.0}), InputError);
}

}  // namespace
}  // namespace lot_share_quantile_test
}  // namespace ringlock::lot
