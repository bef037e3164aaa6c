#include "analysis/study/replay.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <ranges>
#include <vector>

#include "analysis/study/angle_counts.hpp"
#include "engine/compensate/lane_compensator.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/gyro/lane_drive.hpp"
#include "engine/readout/lane_readings.hpp"

namespace ringlock::study {
namespace {

constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

/// A phase of so many fringes and whole ones.
WholePhase whole_phase(double fringes, double whole) {
    const double nearest = std::nearbyint(fringes);
    return {static_cast<std::int64_t>(whole + nearest), units::two_pi * (fringes - nearest)};
}

ReplayedTurn::Reading reading_of(const readout::LaneReadings& readings, std::size_t row) {
    return {readings.sine[row][0], readings.cosine[row][0],
            whole_phase(readings.phase_fringes[row][0], readings.phase_whole[row][0])};
}

/// An error in fringes, the whole ones apart, so that the steps of a large one are exact.
struct Fringes {
    double whole = 0.0;
    double rest = 0.0;

    double rad() const { return units::two_pi * (whole + rest); }
    /// From `before` to this one.
    double step_rad(const Fringes& before) const {
        return units::two_pi * ((whole - before.whole) + (rest - before.rest));
    }
};

/// Root of the mean square of the values that are not NaN.
class MeanSquare {
   public:
    void add(double value) {
        if (std::isnan(value)) return;
        sum_ += value * value;
        ++count_;
    }
    double root() const { return count_ > 0 ? std::sqrt(sum_ / static_cast<double>(count_)) : 0.0; }

   private:
    double sum_ = 0.0;
    std::int64_t count_ = 0;
};

/// The arm's output from turn to turn.
class Output {
   public:
    Output(const scenario::Scenario& scenario, const ensemble::Schedule& schedule, const gyro::Setup& setup)
        : scenario_(scenario), schedule_(schedule), setup_(setup) {}

    /// Goes on to the next turn of the run; gives the angle.
    double next(std::int64_t turn, const simd::LaneCounts& counts) {
        record_turn_ = turn - schedule_.settle_turns();
        if (turn == 0 || record_turn_ == 0) {
            counts_.start(counts);
        } else {
            counts_.turn_to(counts);
        }
        if (record_turn_ >= 0 && turn % 2 == 0) turned_ = counts_.turned(0);
        return angle_arcsec(counts_.angle(0), scenario_.gyro.scale_factor_arcsec);
    }
    /// Sample of the record that this turn is.
    std::optional<std::int64_t> sample() const {
        const std::int64_t every = 2 * schedule_.outputs_per_sample;
        return record_turn_ >= 0 && record_turn_ % every == 0 ? std::optional(record_turn_ / every) : std::nullopt;
    }
    std::optional<double> angle_error_arcsec() const {
        if (record_turn_ < 0) return std::nullopt;
        return angle_arcsec(turned_, setup_.scale_factor_arcsec) -
               setup_.input_rate_deg_h * schedule_.output_s * static_cast<double>(record_turn_ / 2);
    }
    std::optional<double> rate_error_deg_h() const {
        if (record_turn_ / 2 + 1 < schedule_.outputs()) return std::nullopt;
        return study::rate_error_deg_h(turned_, schedule_, setup_);
    }

   private:
    const scenario::Scenario& scenario_;
    const ensemble::Schedule& schedule_;
    const gyro::Setup& setup_;
    AngleCounts counts_;
    std::int64_t record_turn_ = 0;
    WideCounts turned_ = 0;  // until the last minimum of the record
};

}  // namespace

GyroReplay::GyroReplay(const scenario::Scenario& scenario, const scenario::Arm& arm, std::int64_t gyro)
    : scenario_(scenario), arms_{arm}, schedule_(scenario), block_(scenario, arms_, gyro, 1, ensemble::Detail::truth) {}

bool GyroReplay::has_pulses() const { return block_.has_pulses(0); }

double GyroReplay::time_s(std::int64_t turn) const {
    return block_.turn_time_s(turn, 0) - block_.turn_time_s(schedule_.settle_turns(), 0);
}

GyroReplay::Range GyroReplay::turns_between(double from_s, double to_s) const {
    const auto turns = std::views::iota(std::int64_t{0}, schedule_.turns());
    const auto before = [&](double limit_s) { return [this, limit_s](std::int64_t t) { return time_s(t) < limit_s; }; };
    const auto until = [&](double limit_s) { return [this, limit_s](std::int64_t t) { return time_s(t) <= limit_s; }; };
    const auto first = std::ranges::partition_point(turns, before(from_s)) - turns.begin();
    const auto last = std::ranges::partition_point(turns, until(to_s)) - turns.begin();
    return {static_cast<std::int64_t>(first), static_cast<std::int64_t>(std::max(first, last))};
}

ReplayedTurn GyroReplay::turn_at(std::size_t row) const {
    const readout::LaneAngles& angles = block_.angles(0);
    const readout::LaneReadings& seen = block_.observed(0);
    const readout::LaneReadings& hardware = block_.hardware(0);
    const gyro::LaneDrive& drive = block_.drive(0);
    const double phase_per_arcsec = units::two_pi / setup().scale_factor_arcsec;
    ReplayedTurn turn;
    turn.time_s = time_s(seen.first_turn + static_cast<std::int64_t>(row));
    turn.direction = seen.minimum(row) ? 1 : -1;
    turn.zero_rate_s = angles.zero_rate_s[row][0];
    turn.phase = whole_phase(angles.phase_fringes[row][0], seen.phase_whole[row][0]);
    turn.rotation_arcsec =
        setup().scale_factor_arcsec * (drive.rotation_whole[row][0] + drive.rotation_fringes[row][0]);
    turn.dither_amplitude_rad = drive.amplitude_rad[row][0];
    if (drive.amplitudes_change) turn.dither_amplitude_change_rad = drive.amplitude_change_rad[row][0];
    turn.rate_deg_h = drive.rate_rad_s[row][0] / phase_per_arcsec;
    turn.lockin_threshold_deg_h = drive.b_rad_s[row][0] / phase_per_arcsec;
    turn.coupling_phase_rad =
        drive.phases_vary ? units::two_pi * drive.coupling_phase_fringes[row][0] : setup().coupling_phase_rad;
    turn.seen = reading_of(seen, row);
    turn.accel_before_rad_s2 = seen.accel_before_rad_s2[row][0];
    turn.accel_after_rad_s2 = seen.accel_after_rad_s2[row][0];
    for (std::size_t pulse = 0; has_pulses() && pulse < readout::kept_pulses; ++pulse) {
        turn.pulses_before_s[pulse] = seen.pulses.time_s[0][pulse][row][0];
        turn.pulses_after_s[pulse] = seen.pulses.time_s[1][pulse][row][0];
    }
    turn.hardware = reading_of(hardware, row);
    turn.quarter_count = block_.quarter_count(0, row, 0);
    turn.found_zero_rate_s = hardware.zero_rate_s[row][0];
    return turn;
}

ReplayFigures GyroReplay::run(const Range& range, TurnSink& sink, const OnSample& on_sample,
                              const ensemble::Monitor& monitor) {
    ReplayFigures figures;
    Output output(scenario_, schedule_, setup());
    MeanSquare steps, left_steps;
    Fringes error_before{0.0, no_number}, left_before{0.0, no_number};
    std::vector<ReplayedTurn> wanted;
    for (std::int64_t first = 0; first < range.last; first = schedule_.piece_end(first)) {
        if (monitor.cancelled && monitor.cancelled()) throw Interrupted();
        const std::int64_t last = std::min(schedule_.piece_end(first), range.last);
        block_.advance(static_cast<std::size_t>(schedule_.piece_end(first) - first));
        const readout::LaneAngles& angles = block_.angles(0);
        const compensate::LaneErrors* corrections = block_.corrections(0);
        wanted.clear();
        for (std::int64_t number = first; number < last; ++number) {
            const auto row = static_cast<std::size_t>(number - first);
            const double angle = output.next(number, block_.turn_counts(0)[row]);
            if (const auto sample = output.sample()) {
                on_sample(*sample, angle);
                ++figures.samples;
            }
            const Fringes error{angles.lockin_whole[0], angles.lockin_fringes[row][0]};
            const Fringes correction =
                corrections ? Fringes{corrections->whole[0], corrections->fringes[row][0]} : Fringes{};
            const Fringes left{error.whole - correction.whole, error.rest - correction.rest};
            if (number >= range.first) {
                ReplayedTurn& turn = wanted.emplace_back(turn_at(row));
                turn.angle_arcsec = angle;
                turn.lockin_error_rad = error.rad();
                turn.correction_rad = correction.rad();
                turn.lockin_step_rad = error.step_rad(error_before);
                turn.left_step_rad = left.step_rad(left_before);
                steps.add(turn.lockin_step_rad);
                left_steps.add(turn.left_step_rad);
            }
            error_before = error;
            left_before = left;
        }
        if (!wanted.empty()) sink.take(wanted);
        figures.turns += static_cast<std::int64_t>(wanted.size());
        if (monitor.observer) monitor.observer->advance(0, 0, last - first, false);
    }
    figures.angle_error_arcsec = output.angle_error_arcsec();
    figures.rate_error_deg_h = output.rate_error_deg_h();
    figures.lockin_step_rms_rad = steps.root();
    figures.left_step_rms_rad = left_steps.root();
    return figures;
}

}  // namespace ringlock::study
