#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/compensate/lane_compensator.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/gyro/lane_drive.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/reader/reader.hpp"
#include "engine/readout/lane_readings.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/scenario.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::ensemble {

/// Amount of data that a block keeps of its turns.
enum class Detail {
    output,    ///< the output that the arms need
    hardware,  ///< also the data of the electronics at every turn: uncorrected readings, times, counts
    truth,     ///< also the true values at every turn, and the arms' output there
};

/// Readers attached to all gyros and arms of a block.
struct ReaderPlan {
    double output_hz = 0.0;       ///< at which stripped angles are put out
    std::int64_t first_turn = 0;  ///< with which tick 0 falls together, a minimum
};

/// Consecutive gyros of a study, at most simd::lanes, taken through all its arms at once, piece after piece. The
/// results of a gyro depend on the scenario and its own number, never on the block that it is in.
///
/// Rates that vary in time, noise included, are constant over each half cycle, at their mean; the stripping of the
/// dither is exact and refers each angle to the nominal time of its turn.
class GyroBlock {
   public:
    /// Throws RunError where a trajectory cannot be followed, as do the functions below.
    GyroBlock(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t first_gyro,
              std::size_t gyros, Detail detail = Detail::output, const std::optional<ReaderPlan>& readers = {});
    /// The same with parameters of the caller's in place of those that the study would draw.
    GyroBlock(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t first_gyro,
              std::vector<gyro::Setup> setups, Detail detail = Detail::output,
              const std::optional<ReaderPlan>& readers = {});
    GyroBlock(GyroBlock&&) noexcept;
    GyroBlock& operator=(GyroBlock&&) noexcept;
    ~GyroBlock();

    /// Goes through the next `turns` turns, at least one; an even number but for the last piece.
    void advance(std::size_t turns);

    /// Output of an arm at the minima of the piece, [minimum][gyro] in counts of 1/counts_per_fringe fringes.
    std::span<const simd::LaneCounts> counts(std::size_t arm) const;
    /// Readings of the trajectory of an arm. Where no arm of it has a compensator those at maxima are missing.
    const readout::LaneReadings& readings(std::size_t arm) const;
    /// Readings that the compensator of an arm was given; those of the trajectory for an arm without compensator.
    const readout::LaneReadings& observed(std::size_t arm) const;
    /// The readings as the electronics have them, before ellipse or phase are improved, with times and counts; from
    /// Detail::hardware on.
    const readout::LaneReadings& hardware(std::size_t arm) const;
    /// Count of the counter at a turn of the piece, in quarter fringes; from Detail::hardware on.
    std::int64_t quarter_count(std::size_t arm, std::size_t turn, std::size_t lane) const;
    /// Whether readings of an arm hold the times of pulses.
    bool has_pulses(std::size_t arm) const;
    /// Nominal time of a turn of the dither, counted from the start of the run [s].
    double turn_time_s(std::int64_t turn, std::size_t lane) const;
    /// The true values at these turns.
    const readout::LaneAngles& angles(std::size_t arm) const;
    /// Counts of the up/down counters less the true ones at these turns, [turn][gyro] in quarter fringes, for every arm
    /// alike; empty where none is ever missed.
    std::span<const simd::Lanes> count_errors() const;
    /// Lock-in error of the trajectory of an arm at a turn of the piece [rad].
    double lockin_error_rad(std::size_t arm, std::size_t turn, std::size_t lane) const;
    /// The compensator's estimate of that error, at every turn of the piece; null where the arm has no compensator.
    const compensate::LaneErrors* corrections(std::size_t arm) const;
    /// Dither, rates and couplings of the trajectory of an arm over the half cycles of the piece.
    const gyro::LaneDrive& drive(std::size_t arm) const;
    /// counts() at every turn of the piece, maxima included; of Detail::truth only.
    std::span<const simd::LaneCounts> turn_counts(std::size_t arm) const;

    /// The reader of an arm, which has read the piece; only where readers were requested.
    const reader::Reader& reader(std::size_t arm, std::size_t lane) const;

    const std::vector<gyro::Setup>& setups() const;
    /// Physical trajectories that lock-in acts on.
    int trajectories() const;
    /// Rms change of each gyro's dither amplitude from a turn to the next but one under injected noise [rad of optical
    /// phase]; empty without injected noise.
    std::vector<double> change_per_cycle_rad() const;
    double table_error_rad() const;  ///< largest measured when the turn maps were tabulated; 0: no tables
    std::int64_t tables_remade() const;
    /// Times that turn maps of any gyro were tabulated, those of compensators included.
    std::int64_t tables_made() const;
    /// Turns at which pulses and detectors contradicted each other, so that the detectors' phase was kept.
    std::int64_t contradictory_readings() const;

   private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace ringlock::ensemble
