#include "engine/readout/missed_counts.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace ringlock::readout {
namespace missed_counts_test {
namespace {

random::LaneIdentities block_of(std::uint64_t first_gyro) {
    random::LaneIdentities who;
    who.seed = 47;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = first_gyro + lane;
    return who;
}

MissedCounts counters(double probability, std::uint64_t first_gyro = 0) {
    gyro::Setup setup;
    setup.missed_count_probability = probability;
    return {std::vector<gyro::Setup>(simd::lanes, setup), block_of(first_gyro)};
}

std::vector<simd::Lanes> take(MissedCounts& counts, std::size_t turns) {
    const auto rows = counts.next(turns);
    return {rows.begin(), rows.end()};
}

TEST(MissedCounts, WithoutAProbabilityThereIsNothing) {
    MissedCounts none = counters(0.0);
    EXPECT_TRUE(none.next(64).empty());
}

TEST(MissedCounts, AreBehindInTheDirectionOfMotion) {
    // One in every half cycle: one too low at the maxima, made good by the one missed on the way down.
    MissedCounts all = counters(1.0);
    const auto rows = take(all, 100);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            EXPECT_EQ(rows[i][lane], i % 2 == 0 ? 0.0 : -1.0) << i;
        }
    }
    // A few: each step down comes at a maximum, each step up at a minimum, and nothing is missed before the start.
    MissedCounts some = counters(0.1);
    const auto walk = take(some, 1000);
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        EXPECT_EQ(walk[0][lane], 0.0);
        for (std::size_t i = 1; i < walk.size(); ++i) {
            const double step = walk[i][lane] - walk[i - 1][lane];
            if (step != 0.0) {
                EXPECT_EQ(step, i % 2 == 0 ? 1.0 : -1.0) << i;
            }
        }
    }
}

TEST(MissedCounts, ComeWithTheStatedProbabilityWhateverCameBefore) {
    constexpr double probability = 0.03;
    constexpr std::size_t turns = 50'000;
    double misses = 0.0;
    double pairs = 0.0;  // at two turns in a row
    MissedCounts counts = counters(probability);
    const auto rows = take(counts, turns + 1);
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        bool before = false;
        for (std::size_t i = 1; i <= turns; ++i) {
            const bool missed = rows[i][lane] != rows[i - 1][lane];
            misses += missed ? 1.0 : 0.0;
            pairs += missed && before ? 1.0 : 0.0;
            before = missed;
        }
    }
    constexpr double trials = static_cast<double>(turns * simd::lanes);
    // Counts of rare events: four standard deviations, the root of the count each.
    EXPECT_NEAR(misses, trials * probability, 4.0 * std::sqrt(trials * probability));
    EXPECT_NEAR(pairs, trials * probability * probability, 4.0 * std::sqrt(trials * probability * probability));
}

TEST(MissedCounts, AreTheSameInAnyPiecesAndInAnyLane) {
    MissedCounts whole = counters(0.05);
    const auto rows = take(whole, 600);
    MissedCounts parts = counters(0.05);
    MissedCounts shifted = counters(0.05, 1);
    std::size_t at = 0;
    for (const std::size_t turns : {2U, 198U, 256U, 144U}) {
        const auto part = take(parts, turns);
        const auto neighbour = take(shifted, turns);
        for (std::size_t i = 0; i < turns; ++i, ++at) {
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                EXPECT_EQ(part[i][lane], rows[at][lane]);
                if (lane > 0) {
                    EXPECT_EQ(neighbour[i][lane - 1], rows[at][lane]);
                }
            }
        }
    }
}

TEST(MissedCounts, NextToImpossibleOnesDoNotCome) {
    MissedCounts counts = counters(1e-300);
    const auto rows = take(counts, 1000);
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) EXPECT_EQ(rows.back()[lane], 0.0);
}

}  // namespace
}  // namespace missed_counts_test
}  // namespace ringlock::readout
