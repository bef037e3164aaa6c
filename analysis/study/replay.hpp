#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "analysis/study/study.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/readout/electronics.hpp"

/// One gyro of a study simulated anew, in full detail.
namespace ringlock::study {

/// A phase that does not wrap round: whole fringes, and the rest of at most half a fringe.
struct WholePhase {
    std::int64_t whole_fringes = 0;
    double rest_rad = 0.0;
};

/// One turn of the dither, and all that is known of it. Angles and errors count from the first turn of the run.
struct ReplayedTurn {
    double time_s = 0.0;          ///< nominal time of the dither's turn since the start of the record
    std::int8_t direction = 0;    ///< 1: minimum of the phase, -1: maximum
    double angle_arcsec = 0.0;    ///< output of the arm
    double correction_rad = 0.0;  ///< lock-in error that the compensator takes away

    // True values:
    double zero_rate_s = 0.0;  ///< when the phase turns, from the dither's turn
    WholePhase phase;          ///< optical phase there
    double lockin_error_rad = 0.0;
    double lockin_step_rad = 0.0;  ///< that error less the one at the turn before; NaN at the first turn of the run
    double left_step_rad = 0.0;    ///< the same for the error that remains behind the compensator
    double rotation_arcsec = 0.0;  ///< of the case, rates that effects add included
    // Of the half cycle that ends at the turn:
    double dither_amplitude_rad = 0.0;         ///< half its swing in optical phase, injected noise included
    double dither_amplitude_change_rad = 0.0;  ///< at its end less at its beginning
    double rate_deg_h = 0.0;                   ///< mean rate of the case, rates that effects add included
    double lockin_threshold_deg_h = 0.0;
    double coupling_phase_rad = 0.0;

    /// A reading of the electronics.
    struct Reading {
        double sine = 0.0;  ///< detectors
        double cosine = 0.0;
        WholePhase phase;
    };
    Reading seen;  ///< by the compensator
    double accel_before_rad_s2 = 0.0;
    double accel_after_rad_s2 = 0.0;
    double pulses_before_s[readout::kept_pulses] = {};  ///< nearest first; 0 where a pulse was not distinguished
    double pulses_after_s[readout::kept_pulses] = {};
    Reading hardware;  ///< before ellipse or phase are improved
    std::int64_t quarter_count = 0;
    double found_zero_rate_s = 0.0;  ///< when the phase turned, as the electronics find it, from the dither's turn
};

/// Takes turns as they come, one after the other.
class TurnSink {
   public:
    virtual ~TurnSink() = default;
    virtual void take(std::span<const ReplayedTurn> turns) = 0;
};

/// Figures of a replay as a whole.
struct ReplayFigures {
    std::int64_t turns = 0;    ///< handed on
    std::int64_t samples = 0;  ///< of the angle record that were gone through
    /// Angle turned beyond the input's from the start of the record to the last minimum handed on; absent before it.
    std::optional<double> angle_error_arcsec;
    /// Over the whole record: absent where the replay ends before.
    std::optional<double> rate_error_deg_h;
    double lockin_step_rms_rad = 0.0;  ///< of the turns handed on
    double left_step_rms_rad = 0.0;
};

/// A gyro of one arm of a scenario without a design and without readers (reader.output_hz), simulated from its first
/// turn on.
class GyroReplay {
   public:
    /// `scenario` outlives the replay.
    GyroReplay(const scenario::Scenario& scenario, const scenario::Arm& arm, std::int64_t gyro);

    const gyro::Setup& setup() const { return block_.setups().front(); }
    const ensemble::Schedule& schedule() const { return schedule_; }
    /// Whether the readings hold the times of pulses.
    bool has_pulses() const;
    /// Nominal time of a turn of the run since the start of the record [s].
    double time_s(std::int64_t turn) const;
    /// Turns of the run, [first, last).
    struct Range {
        std::int64_t first = 0;
        std::int64_t last = 0;
    };
    /// Those at these times, both ends included; none where first = last.
    Range turns_between(double from_s, double to_s) const;

    /// Called for every sample of the angle record before the end of the range.
    using OnSample = std::function<void(std::int64_t sample, double angle_arcsec)>;
    /// Simulates the gyro up to the end of the range, once, and hands the turns of the range on.
    /// Throws RunError where its trajectory cannot be followed, Interrupted.
    ReplayFigures run(const Range& range, TurnSink& sink, const OnSample& on_sample, const ensemble::Monitor& monitor);

   private:
    ReplayedTurn turn_at(std::size_t row) const;

    const scenario::Scenario& scenario_;
    std::vector<scenario::Arm> arms_;
    ensemble::Schedule schedule_;
    ensemble::GyroBlock block_;
};

}  // namespace ringlock::study
