// How far the tables of the turn map lead astray in a long run with injected noise.
#include "tests/support/long_drive.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace ringlock::test {
namespace long_drive_test {
namespace {

struct Summary {
    double median_final_rad;
    double largest_final_rad;
    double largest_rad;
};

Summary summarise(std::size_t gyros, std::int64_t turns) {
    const auto setups = long_drive_setups(gyros, 15.0, 421);
    auto differences = drive_differences(setups, {.turns = turns});
    std::vector<double> finals;
    double largest = 0.0;
    for (const DriveDifference& difference : differences) {
        finals.push_back(std::abs(difference.final_rad));
        largest = std::max(largest, difference.largest_rad);
    }
    std::sort(finals.begin(), finals.end());
    const Summary summary{finals[finals.size() / 2], finals.back(), largest};
    std::printf("%zu gyros, %lld turns: final difference %.2g rad median, %.2g largest; %.2g largest on the way\n",
                gyros, static_cast<long long>(turns), summary.median_final_rad, summary.largest_final_rad,
                summary.largest_rad);
    return summary;
}

// A turn's error is 1e-10 rad at most. Later turns draw the two phases together on average, at times far apart: the
// logarithm of the difference walks at random, so that single gyros reach much more than the median.
TEST(DriveDifference, StaysSmallFor20000Turns) {
    const Summary summary = summarise(4, 20000);
    EXPECT_GT(summary.largest_rad, 0.0);
    EXPECT_LT(summary.largest_rad, 1e-6);
}

TEST(LongDriveDifference, MedianIsAMicroradianAfterAMillionTurns) {
    EXPECT_LT(summarise(64, 1000000).median_final_rad, 1e-6);
}

}  // namespace
}  // namespace long_drive_test
}  // namespace ringlock::test
