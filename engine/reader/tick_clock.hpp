#pragma once
#include <cstdint>

namespace ringlock::reader {

/// Ticks of a clock that is not tied to the dither, against the turns of the dither.
///
/// Ticks and turns are counted from an instant at which tick 0 and turn 0, a minimum, fall together. A difference of
/// two times in doubles would lose 1e-13 s after ten minutes, in which the phase of a gyro may turn by 5e-7 rad; here
/// both are sums of two doubles, and the difference is right to 1e-18 s after a day.
class TickClock {
   public:
    /// `positive_s`, `negative_s`: durations of the dither's half cycles.
    TickClock(double rate_hz, double positive_s, double negative_s);

    /// Time of a tick after that of a turn [s].
    double after_turn_s(std::int64_t tick, std::int64_t turn) const;
    /// The first tick that is not before a turn.
    std::int64_t first_tick_from(std::int64_t turn) const;
    double rate_hz() const { return rate_hz_; }
    /// Time of a tick since tick 0 [s].
    double time_s(std::int64_t tick) const { return static_cast<double>(tick) / rate_hz_; }

   private:
    double rate_hz_;
    double positive_s_;
    double period_s_;       ///< sum of the half cycles, less ...
    double period_rest_s_;  ///< ... this rounding of it
};

}  // namespace ringlock::reader
