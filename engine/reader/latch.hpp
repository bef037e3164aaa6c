#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/gyro/device.hpp"
#include "engine/gyro/lane_drive.hpp"
#include "engine/random/normal_lanes.hpp"
#include "engine/reader/tick_clock.hpp"

namespace ringlock::reader {

/// An instant at which a gyro is read, and its true phase and dither angle there.
struct Instant {
    bool crossing = false;              ///< an upward zero crossing of the measured dither; otherwise a tick
    std::int64_t tick = 0;              ///< number of the tick; of a crossing that of the tick after it
    double time_s = 0.0;                ///< since tick 0
    std::size_t row = 0;                ///< half cycle of the piece, which ends at turn `row`
    double whole_fringes = 0.0;         ///< optical phase since the start: whole fringes, and ...
    double fringes = 0.0;               ///< ... the rest, within a few thousand
    double dither_fringes = 0.0;        ///< angle of the dither about its mean
    double dither_ahead_fringes = 0.0;  ///< its rate over its angular frequency: the same a quarter of a cycle later
};

/// Rates of the case that vary. The turns contain their rotation from turn to turn, as a constant rate over each half
/// cycle; this gives the angle between the turns.
struct CaseRotation {
    /// Rotation [arcsec] of a gyro of the block from `start_s` after the start of the run on, over `duration_s`, chance
    /// apart; empty where no rate varies.
    std::function<double(std::size_t lane, double start_s, double duration_s)> angle_arcsec = {};
    /// Two-sided power spectral density of the sum of all white rates [arcsec^2/s]: the variance of the angle that it
    /// adds in a second. Random rates that remember longer than a half cycle bend nothing within one.
    double white_arcsec2_s = 0.0;
    random::LaneIdentities who = {};
};

/// Finds the phase of a block of gyros at the ticks of a clock that is not tied to the dither.
class Latch {
   public:
    /// Tick 0 falls together with turn `first_turn` of the run, a minimum.
    Latch(std::span<const gyro::Device> devices, double latch_hz, std::int64_t first_turn);

    /// Zero crossings of the measured dither are wanted, which is late by that.
    void want_crossings(double delay_s) {
        crossings_ = true;
        delay_s_ = delay_s;
    }

    /// From now on the rotation of the case bends between turns, too.
    void follow(const CaseRotation& rotation) { rotation_ = rotation; }

    /// The instants of the next piece, in the order of time: for each gyro those before the last of its turns.
    /// `turns` with the phases in the middles of half cycles, as far as the propagator knows them.
    void read(const gyro::LaneDrive& drive, const gyro::LaneTurns& turns);

    const std::vector<Instant>& instants(std::size_t lane) const { return lanes_[lane].instants; }

   private:
    struct Turn {
        double plain_fringes = 0.0, rotation_fringes = 0.0, rotation_whole = 0.0;
        double lockin_fringes = 0.0, middle_fringes = 0.0, lockin_whole = 0.0;
        double late_s = 0.0;
    };
    struct Lane {
        gyro::Device device;
        TickClock clock;
        std::int64_t next_tick = 0;
        Turn last;  ///< last turn of the piece before
        std::vector<Instant> instants;
    };

    void read_half_cycle(const gyro::LaneDrive& drive, const gyro::LaneTurns& turns, std::size_t row, std::size_t lane);

    std::vector<Lane> lanes_;
    std::int64_t first_turn_;
    CaseRotation rotation_;
    bool crossings_ = false;
    double delay_s_ = 0.0;
    bool begun_ = false;
};

}  // namespace ringlock::reader
