// Times of ticks after turns against extended precision.
#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <random>

#include "engine/reader/tick_clock.hpp"

namespace ringlock::reader {
namespace reader_tick_clock_test {
namespace {

using Exact = boost::multiprecision::cpp_bin_float_50;

TEST(TickClock, DifferencesAreRightAfterADay) {
    std::mt19937_64 engine(31);
    std::uniform_real_distribution<double> uniform;
    for (int draw = 0; draw < 1000; ++draw) {
        const double rate_hz = 1.0 + 5000.0 * uniform(engine);
        const double positive_s = 0.5 / (110.0 + 500.0 * uniform(engine));
        const double negative_s = positive_s * (1.0 + 0.01 * uniform(engine));
        const TickClock clock(rate_hz, positive_s, negative_s);
        const auto cycle = static_cast<std::int64_t>(86400.0 * uniform(engine) / (positive_s + negative_s));
        const std::int64_t turn = 2 * cycle + (draw % 2);
        const std::int64_t tick = clock.first_tick_from(turn);
        const Exact turn_s = Exact(cycle) * (Exact(positive_s) + Exact(negative_s)) + (draw % 2) * Exact(positive_s);
        const Exact difference = Exact(tick) / Exact(rate_hz) - turn_s;
        const double told_s = clock.after_turn_s(tick, turn);
        EXPECT_GE(told_s, 0.0);
        EXPECT_LT(told_s, 1.0000001 / rate_hz);
        EXPECT_NEAR(static_cast<double>(difference - Exact(told_s)), 0.0, 1e-16 * (1.0 / rate_hz + 2.0 * positive_s));
    }
}

TEST(TickClock, TicksBeforeTheFirstTurnHaveTimesToo) {
    const TickClock clock(100.0, 0.00125, 0.00125);
    EXPECT_DOUBLE_EQ(clock.after_turn_s(0, -1), 0.00125);
    EXPECT_DOUBLE_EQ(clock.after_turn_s(0, 0), 0.0);
    EXPECT_EQ(clock.first_tick_from(0), 0);
    EXPECT_EQ(clock.first_tick_from(1), 1);
}

}  // namespace
}  // namespace reader_tick_clock_test
}  // namespace ringlock::reader
