#include "engine/reader/tick_clock.hpp"

#include <cmath>

namespace ringlock::reader {

TickClock::TickClock(double rate_hz, double positive_s, double negative_s)
    : rate_hz_(rate_hz), positive_s_(positive_s), period_s_(positive_s + negative_s) {
    // Knuth's exact sum of two doubles.
    const double second = period_s_ - positive_s;
    period_rest_s_ = (positive_s - (period_s_ - second)) + (negative_s - second);
}

double TickClock::after_turn_s(std::int64_t tick, std::int64_t turn) const {
    const std::int64_t cycle = turn >= 0 ? turn / 2 : (turn - 1) / 2;
    const auto number = static_cast<double>(tick);
    const auto cycles = static_cast<double>(cycle);
    const double tick_s = number / rate_hz_;
    const double tick_rest_s = std::fma(-tick_s, rate_hz_, number) / rate_hz_;
    const double turn_s = cycles * period_s_;
    const double turn_rest_s = std::fma(cycles, period_s_, -turn_s) + cycles * period_rest_s_;
    const double half_s = turn - 2 * cycle == 0 ? 0.0 : positive_s_;
    return ((tick_s - turn_s) - half_s) + (tick_rest_s - turn_rest_s);
}

std::int64_t TickClock::first_tick_from(std::int64_t turn) const {
    auto tick = static_cast<std::int64_t>(std::ceil(-after_turn_s(0, turn) * rate_hz_));
    while (after_turn_s(tick, turn) < 0.0) ++tick;
    while (after_turn_s(tick - 1, turn) >= 0.0) --tick;
    return tick;
}

}  // namespace ringlock::reader
