#include <gtest/gtest.h>

#include <cmath>

#include "analysis/noise/ensemble.hpp"
#include "engine/core/error.hpp"
#include "engine/random/stream.hpp"

namespace allan_ensemble_test {
namespace {

using namespace ringlock;

TEST(AllanEnsemble, QuantilesOfKnownValues) {
    const std::vector<double> v = {4.0, 1.0, 3.0, 2.0, 5.0};
    EXPECT_DOUBLE_EQ(noise::quantile(v, 0.0), 1.0);
    EXPECT_DOUBLE_EQ(noise::quantile(v, 0.5), 3.0);
    EXPECT_DOUBLE_EQ(noise::quantile(v, 0.625), 3.5);
    EXPECT_DOUBLE_EQ(noise::quantile(v, 1.0), 5.0);
    std::vector<double> ladder;
    for (int i = 0; i <= 1000; ++i) ladder.push_back(i);
    const noise::Range r = noise::central_range(ladder);
    EXPECT_NEAR(r.median, 500.0, 1e-9);
    EXPECT_NEAR(r.hi - r.lo, 682.689, 0.01);
    const std::vector<double> one = {7.0};
    EXPECT_EQ(noise::central_range(one).lo, 7.0);
}

TEST(AllanEnsemble, BootstrapIntervalCoversTheMedian) {
    int covered = 0;
    constexpr int trials = 300;
    for (int k = 0; k < trials; ++k) {
        random::NormalStream g({55, static_cast<std::uint64_t>(k)}, random::Purpose::initial_phase);
        std::vector<double> v(60);
        for (double& x : v) x = std::exp(g());
        const noise::Range r = noise::bootstrap_median_interval(v, 0.95, k, 500);
        EXPECT_LE(r.lo, r.median);
        EXPECT_GE(r.hi, r.median);
        covered += r.lo <= 1.0 && 1.0 <= r.hi ? 1 : 0;
    }
    EXPECT_GE(covered, trials * 91 / 100);
    EXPECT_LE(covered, trials * 99 / 100);
}

TEST(AllanEnsemble, BootstrapIsDeterministicAndSeeded) {
    const std::vector<double> v = {1.0, 2.5, 2.7, 3.1, 4.0, 8.0, 9.0, 11.5};
    const noise::Range a = noise::bootstrap_median_interval(v, 0.95, 1, 101);
    const noise::Range b = noise::bootstrap_median_interval(v, 0.95, 1, 101);
    EXPECT_EQ(a.lo, b.lo);
    EXPECT_EQ(a.hi, b.hi);
    EXPECT_DOUBLE_EQ(a.median, 3.55);
    bool differs = false;
    for (std::uint64_t seed = 2; seed < 8; ++seed) {
        const noise::Range c = noise::bootstrap_median_interval(v, 0.95, seed, 101);
        differs = differs || c.lo != a.lo || c.hi != a.hi;
    }
    EXPECT_TRUE(differs);
}

TEST(AllanEnsemble, RefusesNothingAndNan) {
    EXPECT_THROW(noise::central_range({}), InputError);
    const std::vector<double> bad = {1.0, std::nan("")};
    EXPECT_THROW(noise::bootstrap_median_interval(bad, 0.95, 1), InputError);
    const std::vector<double> good = {1.0};
    EXPECT_THROW(noise::bootstrap_median_interval(good, 1.5, 1), InputError);
}

}  // namespace
}  // namespace allan_ensemble_test
