#pragma once
#include "engine/gyro/lane_drive.hpp"
#include "engine/propagate/turn_tables.hpp"

namespace ringlock::propagate {

/// Where a block of gyros stands between two turns, in the middle of a half cycle.
struct TurnState {
    /// Phase that the lock-in has added up to the middle, in the frame in which fast motion is rotation; less `whole`.
    simd::Lanes lockin_fringes;
    simd::Lanes whole;
    simd::Lanes coupling_phase_fringes;  ///< where the drive has none
    // Second half of the half cycle under way.
    simd::Lanes shift_fringes, z_re, z_im;
};

/// Goes through the turns of `drive` by the exact turn map.
///
/// `state`: as left by the turns before; at the beginning of a run all zero but for the coupling phase, which lets the
/// motion begin at the turn itself. `lanes`: gyros to go through, from the first; rounded up to whole vectors. `turns`
/// is filled where given, which costs a second division and arctangent a turn.
void step_turns(const TurnTables& tables, const gyro::LaneDrive& drive, std::size_t lanes, TurnState& state,
                gyro::LaneTurns* turns);

/// Smallest and largest value of each gyro over the half cycles that begin in a piece: of rows[1] and all after it.
void extremes(const std::vector<simd::Lanes>& rows, simd::Lanes& lowest, simd::Lanes& highest);

}  // namespace ringlock::propagate
