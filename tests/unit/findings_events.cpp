// Events in noise: sizes by generalised least squares against sums written out, and the search for them.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "analysis/findings/clean_fit.hpp"
#include "analysis/findings/events.hpp"
#include "analysis/findings/search.hpp"
#include "engine/core/units.hpp"

namespace findings_events_test {
namespace {

using namespace ringlock::findings;
using ringlock::units::pi;

std::vector<double> white(std::size_t n, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    std::vector<double> rate(n);
    for (double& r : rate) r = noise(random);
    return rate;
}

std::vector<double> cosines_of(const std::vector<double>& rate) {
    const auto n = static_cast<double>(rate.size());
    std::vector<double> z;
    for (std::size_t j = 1; j < rate.size(); ++j) {
        double sum = 0.0;
        for (std::size_t i = 0; i < rate.size(); ++i) {
            sum += rate[i] * std::cos(pi * static_cast<double>(j) * (static_cast<double>(i) + 0.5) / n);
        }
        z.push_back(std::sqrt(2.0 / n) * sum);
    }
    return z;
}

TEST(Events, SizesAreThoseOfLeastSquares) {
    const std::vector<double> residual = cosines_of(white(30, 1));
    std::vector<double> variance;
    for (std::size_t j = 1; j < 30; ++j) variance.push_back(0.5 + 1.0 / static_cast<double>(j));
    for (const Event event : {Event::pulse, Event::doublet, Event::step}) {
        const Scan found = scan(event, residual, variance);
        for (std::size_t t = event == Event::step ? 1 : 0; t < found.size.size(); ++t) {
            std::vector<double> one(30, 0.0);
            take_off(event, t, -1.0, one);
            const std::vector<double> shape = cosines_of(one);
            double numerator = 0.0;
            double denominator = 0.0;
            for (std::size_t j = 0; j < shape.size(); ++j) {
                numerator += shape[j] * residual[j] / variance[j];
                denominator += shape[j] * shape[j] / variance[j];
            }
            EXPECT_NEAR(found.size[t], numerator / denominator, 1e-12) << t;
            EXPECT_NEAR(found.sigma[t], numerator / std::sqrt(denominator), 1e-12) << t;
        }
    }
}

TEST(Events, WhiteNoiseWhitenedIsItself) {
    const std::vector<double> rate = white(30, 2);
    const std::vector<double> back = whitened(cosines_of(rate), std::vector<double>(29, 1.0));
    double mean = 0.0;
    for (const double r : rate) mean += r / 30.0;
    for (std::size_t i = 0; i < 30; ++i) EXPECT_NEAR(back[i], rate[i] - mean, 1e-12);
}

TEST(Search, NothingIsFoundInNoise) {
    int found = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        std::vector<double> rate = white(1000, seed);
        std::mt19937_64 random(seed);
        std::normal_distribution<double> noise;
        // Every other one with a random walk of the rate, of which a plain search for one jump makes a jump.
        double walk = 0.0;
        for (double& r : rate) {
            walk += seed % 2 == 0 ? 0.05 * noise(random) : 0.0;
            r += walk;
        }
        found += search_rates(rate, false).findings.empty() ? 0 : 1;
    }
    EXPECT_EQ(found, 0);
}

TEST(Search, OutliersAreFoundAndTakenOff) {
    std::vector<double> rate = white(2000, 3);
    for (const auto& [row, size] : {std::pair{100, 100.0}, {101 + 500, -8.0}, {1990, 20.0}}) {
        rate[static_cast<std::size_t>(row)] += size;
    }
    const Searched searched = search_rates(rate, false);
    ASSERT_EQ(searched.findings.size(), 3U);
    EXPECT_EQ(searched.findings[0].row, 100U);
    EXPECT_NEAR(searched.findings[0].size, 100.0, 4.0);
    EXPECT_EQ(searched.findings[1].row, 601U);
    EXPECT_EQ(searched.findings[2].row, 1990U);
    for (const Finding& f : searched.findings) EXPECT_EQ(f.kind, Kind::outlier);
    // Of each only the estimate for its row is left: the others are as they were.
    for (std::size_t i = 0; i < rate.size(); ++i) {
        if (i == 100 || i == 601 || i == 1990) continue;
        EXPECT_EQ(searched.rate[i], rate[i]);
    }
}

// 2003 rates have a prime number for their length: the spectrum leaves out the last of them.
TEST(Search, OutliersAtTheEndOfAnAwkwardLengthAreFound) {
    std::vector<double> rate = white(2003, 7);
    rate[2001] += 12.0;
    const Searched searched = search_rates(rate, false);
    ASSERT_EQ(searched.findings.size(), 1U);
    EXPECT_EQ(searched.findings[0].kind, Kind::outlier);
    EXPECT_EQ(searched.findings[0].row, 2001U);
    EXPECT_NEAR(searched.findings[0].size, 12.0, 4.0);
    EXPECT_NEAR(searched.rate[2001], rate[2001] - searched.findings[0].size, 1e-12);
    rate[2001] -= 12.0;
    EXPECT_TRUE(search_rates(rate, false).findings.empty());
}

// An angle that is off by itself moves two rates; a step of the angle moves one.
TEST(Search, AnglesAreOffByThemselvesOrForGood) {
    std::vector<double> rate = white(2000, 4);
    rate[700] += 30.0;
    rate[701] -= 30.0;
    rate[1200] += 30.0;
    const Searched searched = search_rates(rate, true);
    ASSERT_EQ(searched.findings.size(), 2U);
    EXPECT_EQ(searched.findings[0].kind, Kind::outlier);
    EXPECT_EQ(searched.findings[0].row, 701U);
    EXPECT_NEAR(searched.findings[0].size, 30.0, 4.0);
    EXPECT_EQ(searched.findings[1].kind, Kind::jump);
    EXPECT_TRUE(searched.findings[1].of_angle);
}

TEST(Search, AJumpIsFoundWithItsSize) {
    std::vector<double> rate = white(2000, 5);
    for (std::size_t i = 600; i < rate.size(); ++i) rate[i] += 2.0;
    const Searched searched = search_rates(rate, false);
    ASSERT_EQ(searched.findings.size(), 1U);
    EXPECT_EQ(searched.findings[0].kind, Kind::jump);
    EXPECT_NEAR(static_cast<double>(searched.findings[0].row), 600.0, 3.0);
    EXPECT_NEAR(searched.findings[0].size, 2.0, 0.2);  // four standard errors
}

std::vector<double> angle_of(const std::vector<double>& rate) {
    std::vector<double> angle{0.0};
    for (const double r : rate) angle.push_back(angle.back() + r);
    return angle;
}

// Jumps that are too small to be found must not be called a random walk, and a random walk stays one.
TEST(CleanFit, AJumpIsNoRandomWalk) {
    int tied = 0;
    for (std::uint64_t seed = 100; seed < 130; ++seed) {
        std::vector<double> rate = white(2000, seed);
        for (std::size_t i = 1680; i < rate.size(); ++i) rate[i] += 1.1;
        const CleanFit fit = fit_without_events(angle_of(rate), 1.0, false);
        EXPECT_FALSE(fit.noise.rrw_deg_h_rt_h.resolved) << seed;
        tied += fit.instead_of_walk.has_value() ? 1 : 0;
    }
    EXPECT_GT(tied, 0) << "no jump was near enough to a random walk to be compared with it";
    for (std::uint64_t seed = 200; seed < 205; ++seed) {
        std::vector<double> rate = white(2000, seed);
        const std::vector<double> steps = white(2000, seed + 1000);
        double walk = 0.0;
        for (std::size_t i = 0; i < rate.size(); ++i) rate[i] += walk += 0.15 * steps[i];
        const CleanFit fit = fit_without_events(angle_of(rate), 1.0, false);
        EXPECT_TRUE(fit.noise.rrw_deg_h_rt_h.resolved) << seed;
        EXPECT_FALSE(fit.instead_of_walk.has_value()) << seed;
    }
}

TEST(Search, AStretchOfLargerNoiseIsFound) {
    std::vector<double> rate = white(4000, 6);
    for (std::size_t i = 1000; i < 1500; ++i) rate[i] *= 2.0;
    const Searched searched = search_rates(rate, false);
    ASSERT_FALSE(searched.findings.empty());
    EXPECT_EQ(searched.findings[0].kind, Kind::variance);
    EXPECT_GE(searched.findings[0].row + 250, 1000U);
    EXPECT_LE(searched.findings[0].row, 1250U);
}

TEST(Search, ShortOrConstantSeriesAreLeftAlone) {
    EXPECT_TRUE(search_rates(std::vector<double>(20, 1.0), false).findings.empty());
    EXPECT_TRUE(search_rates(std::vector<double>(500, 1.0), false).findings.empty());
}

}  // namespace
}  // namespace findings_events_test
