#include "engine/reader/latch.hpp"

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/propagate/between_turns.hpp"

namespace ringlock::reader {

namespace {

/// Rotation by varying rates within one half cycle of one gyro, less that of a constant rate over it: zero at both
/// ends.
class Bend {
   public:
    Bend(const CaseRotation& rotation, std::size_t lane, double start_s, double duration_s)
        : rotation_(rotation), lane_(lane), start_s_(start_s), duration_s_(duration_s) {
        if (rotation.angle_arcsec) whole_arcsec_ = rotation.angle_arcsec(lane, start_s, duration_s);
    }

    /// Value at an instant after the start, which must not be before that of the previous call; `number` selects its
    /// random number.
    double arcsec(double after_s, std::uint64_t number) {
        after_s = std::clamp(after_s, 0.0, duration_s_);
        double bend_arcsec = 0.0;
        if (rotation_.angle_arcsec) {
            bend_arcsec = rotation_.angle_arcsec(lane_, start_s_, after_s) - after_s / duration_s_ * whole_arcsec_;
        }
        return bend_arcsec + white_arcsec(after_s, number);
    }

   private:
    /// A Brownian bridge: the angle of a white rate whose values at both turns are known.
    double white_arcsec(double after_s, std::uint64_t number) {
        if (rotation_.white_arcsec2_s == 0.0) return 0.0;
        const double left_s = duration_s_ - last_s_;
        if (left_s > 0.0) {
            const double share = (after_s - last_s_) / left_s;
            const double rms_arcsec = std::sqrt(rotation_.white_arcsec2_s * (after_s - last_s_) * (1.0 - share));
            const random::Identity who{rotation_.who.seed, rotation_.who.gyro[lane_]};
            last_arcsec_ = (1.0 - share) * last_arcsec_ +
                           rms_arcsec * random::normal(who, random::Purpose::white_rate_between_turns, number);
            last_s_ = after_s;
        }
        return last_arcsec_;
    }

    const CaseRotation& rotation_;
    std::size_t lane_;
    double start_s_;
    double duration_s_;
    double whole_arcsec_ = 0.0;
    double last_s_ = 0.0;
    double last_arcsec_ = 0.0;
};

}  // namespace

Latch::Latch(std::span<const gyro::Device> devices, double latch_hz, std::int64_t first_turn)
    : first_turn_(first_turn) {
    for (const gyro::Device& device : devices) {
        lanes_.push_back({device, {latch_hz, device.positive_duration_s, device.negative_duration_s}, 0, {}, {}});
    }
}

void Latch::read(const gyro::LaneDrive& drive, const gyro::LaneTurns& turns) {
    const std::size_t last = drive.turns - 1;
    for (std::size_t lane = 0; lane < lanes_.size(); ++lane) {
        lanes_[lane].instants.clear();
        for (std::size_t row = begun_ ? 0 : 1; row < drive.turns; ++row) read_half_cycle(drive, turns, row, lane);
        lanes_[lane].last = {drive.plain_fringes[last][lane],
                             drive.rotation_fringes[last][lane],
                             drive.rotation_whole[last][lane],
                             turns.lockin_fringes[last][lane],
                             turns.lockin_middle_fringes[last][lane],
                             turns.lockin_whole[lane],
                             drive.late_s.empty() ? 0.0 : drive.late_s[last][lane]};
    }
    begun_ = true;
}

void Latch::read_half_cycle(const gyro::LaneDrive& drive, const gyro::LaneTurns& turns, std::size_t row,
                            std::size_t lane) {
    Lane& own = lanes_[lane];
    const gyro::Device& device = own.device;
    // Turns are counted from the one at tick 0.
    const std::int64_t begins = drive.first_turn + static_cast<std::int64_t>(row) - 1 - first_turn_;
    const bool rises = begins % 2 == 0;
    const double duration_s = rises ? device.positive_duration_s : device.negative_duration_s;
    const double end_late_s = drive.late_s.empty() ? 0.0 : drive.late_s[row][lane];
    const auto before_end = [&](std::int64_t tick) {
        return own.clock.after_turn_s(tick, begins) < duration_s + end_late_s;
    };
    // Where the clock is slow most half cycles have no tick.
    const bool ticks = begins >= 0 && before_end(own.next_tick);
    if (begins < 0 || (!ticks && !(crossings_ && rises))) return;

    Turn start = own.last;
    if (row > 0) {
        start = {drive.plain_fringes[row - 1][lane],
                 drive.rotation_fringes[row - 1][lane],
                 drive.rotation_whole[row - 1][lane],
                 turns.lockin_fringes[row - 1][lane],
                 turns.lockin_middle_fringes[row - 1][lane],
                 turns.lockin_whole[lane],
                 drive.late_s.empty() ? 0.0 : drive.late_s[row - 1][lane]};
    }
    const double carried = start.lockin_whole - turns.lockin_whole[lane];  // by the piece before
    const propagate::PassedHalfCycle passed{gyro::half_cycle_of(device, drive, row, lane),
                                            gyro::coupling_of(device, drive, row, lane),
                                            start.plain_fringes,
                                            start.lockin_fringes + carried,
                                            turns.lockin_fringes[row][lane],
                                            start.middle_fringes + carried};
    const gyro::HalfCycle& half = passed.half;
    const double swing = 2.0 * device.dither_amplitude_rad / units::two_pi;
    const double swing_whole = rises ? 0.0 : std::nearbyint(swing);
    const double dither_at_turn = start.plain_fringes - start.rotation_fringes -
                                  device.initial_phase_rad / units::two_pi + swing_whole - 0.5 * swing;
    // A noisy drive turns late; between two of its turns its motion is that between nominal turns, as long in all.
    const double slower = 1.0 + (end_late_s - start.late_s) / duration_s;
    const auto place = [&](double after_turn_s) {
        return std::clamp((after_turn_s - start.late_s) / slower, 0.0, duration_s);
    };
    const auto dither_fringes = [&](double after_turn_s) {
        return dither_at_turn +
               (half.plain_phase_rad(place(after_turn_s)) - half.rate_rad_s * after_turn_s) / units::two_pi;
    };
    const auto dither_rate_hz = [&](double after_turn_s) {
        return (half.drive_rate_rad_s(place(after_turn_s)) / slower - half.rate_rad_s) / units::two_pi;
    };
    const double begins_s = own.clock.time_s(0) - own.clock.after_turn_s(0, begins);
    // Rates vary with the run's time between nominal turns; the record begins at turn `first_turn_`, a minimum.
    const double period_s = device.positive_duration_s + device.negative_duration_s;
    Bend bend(rotation_, lane, begins_s + 0.5 * static_cast<double>(first_turn_) * period_s, duration_s);
    const auto instant_at = [&](double after_turn_s, std::uint64_t number) {
        const double t_s = place(after_turn_s);
        Instant instant;
        instant.row = row;
        instant.time_s = begins_s + after_turn_s;
        instant.whole_fringes = start.rotation_whole + turns.lockin_whole[lane] + swing_whole;
        instant.fringes = start.plain_fringes + propagate::lockin_between_turns_fringes(passed, t_s) +
                          half.plain_phase_rad(t_s) / units::two_pi +
                          bend.arcsec(t_s, number) * device.phase_per_arcsec / units::two_pi;
        instant.dither_fringes = dither_fringes(after_turn_s);
        instant.dither_ahead_fringes = dither_rate_hz(after_turn_s) / half.angular_frequency_rad_s();
        return instant;
    };

    bool crossing_due = crossings_ && rises;
    double crossing_s = 0.0;
    if (crossing_due) {
        crossing_s = 0.5 * duration_s + start.late_s;
        for (int pass = 0; pass < 8; ++pass) crossing_s -= dither_fringes(crossing_s) / dither_rate_hz(crossing_s);
        crossing_s += delay_s_;
    }
    const auto cross = [&] {
        own.instants.push_back(instant_at(crossing_s, 2 * static_cast<std::uint64_t>(begins) + 1));
        own.instants.back().crossing = true;
        own.instants.back().tick = own.next_tick;
        crossing_due = false;
    };
    for (; before_end(own.next_tick); ++own.next_tick) {
        const double at_s = own.clock.after_turn_s(own.next_tick, begins);
        if (crossing_due && crossing_s < at_s) cross();
        own.instants.push_back(instant_at(at_s, 2 * static_cast<std::uint64_t>(own.next_tick)));
        own.instants.back().tick = own.next_tick;
        own.instants.back().time_s = own.clock.time_s(own.next_tick);
    }
    if (crossing_due) cross();
}

}  // namespace ringlock::reader
