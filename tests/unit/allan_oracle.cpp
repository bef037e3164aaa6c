#include "tests/support/allan_oracle.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "engine/simd/target.hpp"

/// The estimators against their definitions in quadruple precision.
namespace allan_oracle_test {
namespace {

using namespace ringlock;

/// Relative distance of a deviation from the oracle's.
double distance(double dev, test::Quad variance) {
    const test::Quad mine = static_cast<test::Quad>(dev) * dev;
    return std::abs(static_cast<double>((mine - variance) / variance)) / 2.0;
}

/// Counts of a fast counter: 10 MHz and a random walk, white noise of a few counts, a slow drift.
std::vector<std::int64_t> counts(std::size_t n, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_int_distribution<std::int64_t> step(-40, 40);
    std::vector<std::int64_t> out;
    std::int64_t walk = 0;
    for (std::size_t i = 0; i < n; ++i) {
        walk += step(random);
        const auto k = static_cast<std::int64_t>(i);
        out.push_back(4'000'000'000'000'000'000 + 10'000'003 * k + walk + step(random) + k * k / 900);
    }
    return out;
}

std::vector<test::Quad> whole(const std::vector<std::int64_t>& counts) { return {counts.begin(), counts.end()}; }

std::vector<std::int64_t> some_factors(allan::Estimator e, std::int64_t points) {
    std::vector<std::int64_t> out;
    const std::int64_t largest = allan::largest_factor(e, points);
    for (const std::int64_t m : {1, 2, 3, 5, 8, 21, 64, 100}) {
        if (m < largest) out.push_back(m);
    }
    out.push_back(largest);
    return out;
}

// The counts are beyond 2^53, so that a double would have lost their last digits.
TEST(LongAllanOracle, CountsAreExactInEveryEstimator) {
    constexpr std::size_t n = 401;
    const std::vector<std::int64_t> x = counts(n, 1);
    const allan::Phase phase = allan::phase_of(x, {}, allan::Kind::phase, 1.0, 1.0);
    for (const allan::Traits& t : allan::all_estimators) {
        const std::vector<std::int64_t> factors = some_factors(t.estimator, n);
        const auto points = allan::deviation(t.estimator, phase, 1.0, factors, {.bias = allan::Bias::none});
        ASSERT_EQ(points.size(), factors.size());
        for (const allan::Point& p : points) {
            EXPECT_LE(distance(p.dev, test::oracle_variance(t.estimator, whole(x), p.m)), 1e-13)
                << t.name << " m = " << p.m;
        }
    }
}

// Longer than the pieces that sums are cut into (8192 starts), with steps on both sides of what fits the cache.
TEST(AllanOracle, LongRecordsAreExactInPiecesAndColumns) {
    constexpr std::int64_t n = 70'001;
    const std::vector<std::int64_t> x = counts(n, 2);
    const allan::Phase phase = allan::phase_of(x, {}, allan::Kind::phase, 1.0, 1.0);
    using allan::Estimator;
    for (const Estimator e :
         {Estimator::oadev, Estimator::ohdev, Estimator::adev, Estimator::mdev, Estimator::totdev, Estimator::tierms}) {
        std::vector<std::int64_t> factors = allan::octave_factors(allan::largest_factor(e, n));
        for (const std::int64_t m : {3, 1000, 8191, 8193, 9000, 12345, 18000, 20000}) factors.push_back(m);
        for (const allan::Point& p : allan::deviation(e, phase, 1.0, factors, {.bias = allan::Bias::none})) {
            EXPECT_LE(distance(p.dev, test::oracle_variance(e, whole(x), p.m)), 1e-13)
                << allan::name(e) << " m = " << p.m;
        }
    }
}

TEST(AllanOracle, IncrementsOfCountsAreThePhase) {
    const std::vector<std::int64_t> x = counts(500, 3);
    std::vector<std::int64_t> steps;
    for (std::size_t i = 0; i + 1 < x.size(); ++i) steps.push_back(x[i + 1] - x[i]);
    const allan::Phase phase = allan::phase_of(steps, {}, allan::Kind::increment, 1.0, 1.0);
    for (const allan::Traits& t : allan::all_estimators) {
        const std::vector<std::int64_t> factors = {1, 7, 50};
        for (const allan::Point& p : allan::deviation(t.estimator, phase, 1.0, factors, {.bias = allan::Bias::none})) {
            EXPECT_LE(distance(p.dev, test::oracle_variance(t.estimator, whole(x), p.m)), 1e-13)
                << t.name << " m = " << p.m;
        }
    }
}

// Real numbers: what is measured in units of 0.1 has no exact digits, but centring must not lose any either.
TEST(AllanOracle, RealPhaseFarFromZeroKeepsItsDigits) {
    const std::vector<std::int64_t> x = counts(400, 4);
    std::vector<double> real;
    std::vector<test::Quad> exact;
    for (std::size_t i = 0; i < x.size(); ++i) {
        // A value in a double, and the same value for the oracle.
        real.push_back(1e9 + 0.001 * static_cast<double>(x[i] - x[0]));
        exact.push_back(real.back());
    }
    const allan::Phase phase = allan::phase_of(real, allan::Kind::phase, 1.0);
    for (const allan::Traits& t : allan::all_estimators) {
        const std::vector<std::int64_t> factors = {1, 7, 50};
        for (const allan::Point& p : allan::deviation(t.estimator, phase, 1.0, factors, {.bias = allan::Bias::none})) {
            EXPECT_LE(distance(p.dev, test::oracle_variance(t.estimator, exact, p.m)), 1e-13)
                << t.name << " m = " << p.m;
        }
    }
}

// Octaves of a record longer than a piece take every way that sums are made: four octaves at once, single steps,
// columns, third differences, means of a phase with gaps, pieces one by one and together.
TEST(AllanOracle, BitsDependNeitherOnTheInstructionSetNorOnThreads) {
    const std::vector<std::int64_t> x = counts(70'001, 5);
    std::vector<double> real;
    for (const std::int64_t v : x) real.push_back(0.1 * static_cast<double>(v - x[0]));
    const allan::Phase whole = allan::phase_of(real, allan::Kind::phase, 1.0);
    real[12'345] = std::numeric_limits<double>::quiet_NaN();
    const allan::Phase gapped = allan::phase_of(real, allan::Kind::phase, 1.0);
    using allan::Estimator;
    const auto all = [&] {
        std::vector<double> out;
        for (const allan::Phase* phase : {&whole, &gapped}) {
            for (const Estimator e : {Estimator::oadev, Estimator::ohdev, Estimator::adev, Estimator::mdev,
                                      Estimator::totdev, Estimator::tierms, Estimator::mtotdev, Estimator::htotdev}) {
                const auto factors = allan::octave_factors(allan::largest_factor(e, 70'001));
                for (const allan::Point& p : allan::deviation(e, *phase, 1.0, factors)) out.push_back(p.dev);
            }
        }
        return out;
    };
    const std::vector<double> best = all();
    for (const std::string& target : simd::available_targets()) {
        simd::use_target(target);
        EXPECT_EQ(all(), best) << target;
    }
    simd::use_best_target();
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(all(), best);
}

}  // namespace
}  // namespace allan_oracle_test
