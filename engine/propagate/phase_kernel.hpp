#pragma once
#include "engine/gyro/lane_drive.hpp"
#include "engine/propagate/phase_tables.hpp"

namespace ringlock::propagate {

/// Where a block of gyros stands between two turns, in the middle of a half cycle.
struct PhaseState {
    /// Phase that the lock-in has added up to the middle, in the frame in which fast motion is rotation; less `whole`.
    simd::Lanes lockin_fringes;
    simd::Lanes whole;
    simd::Lanes coupling_phase_fringes;  ///< where the drive has none
    /// Some turn was gone through: the half cycle that ends at the next one has a second half.
    bool under_way = false;
};

/// Goes through the turns of `drive` by tabulated half turns: the counterpart of step_turns() of turn_kernel.hpp for
/// couplings with a second harmonic.
///
/// `state`: as left by the turns before; at the beginning of a run all zero but for the coupling phase, which lets the
/// motion begin at the turn itself. `lanes`: gyros to go through, from the first; rounded up to whole vectors. `turns`
/// is filled where given.
void step_phases(const PhaseTables& tables, const gyro::LaneDrive& drive, std::size_t lanes, PhaseState& state,
                 gyro::LaneTurns* turns);

}  // namespace ringlock::propagate
