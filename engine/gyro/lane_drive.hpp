#pragma once
#include <cstdint>
#include <vector>

#include "engine/gyro/device.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::gyro {

/// Motion of a block of gyros by the dither and the input over some consecutive turns: one row for each turn or half
/// cycle, one column for each gyro. Turn 0 of a run is a minimum of the phase.
///
/// Half cycle i ends at turn i of the piece, half cycle i + 1 begins there.
struct LaneDrive {
    std::int64_t first_turn = 0;
    std::size_t turns = 0;
    bool rates_vary = false;  ///< from half cycle to half cycle
    bool thresholds_vary = false;
    bool phases_vary = false;                ///< of the coupling
    bool amplitudes_change = false;          ///< over half cycles
    bool constants_filled = false;           ///< rows of rates and couplings that do not vary stand from a piece before
    std::vector<simd::Lanes> plain_fringes;  ///< [turns] phase of drive and input at the turn, less whole fringes
    std::vector<simd::Lanes> amplitude_rad;  ///< [turns + 1] amplitude of the half cycle: half its swing
    std::vector<simd::Lanes> rate_rad_s;     ///< [turns + 1] phase rate of the input over the half cycle
    std::vector<simd::Lanes> b_rad_s;        ///< [turns + 1] coupling over the half cycle
    /// [turns + 1] amplitude at the end of the half cycle less that at its beginning; empty where it is constant over
    /// each half cycle.
    std::vector<simd::Lanes> amplitude_change_rad;
    /// [turns + 1] phase of the coupling over the half cycle; empty where it is always the gyro's own.
    std::vector<simd::Lanes> coupling_phase_fringes;
    std::vector<simd::Lanes> late_s;            ///< [turns] by which a noisy drive turns late; empty where none does
    std::vector<simd::Lanes> rotation_fringes;  ///< [turns] rotation of the case since turn 0 of the run, less ...
    std::vector<simd::Lanes> rotation_whole;    ///< [turns] ... these whole fringes

    void resize(std::size_t wanted) {
        constants_filled = constants_filled && wanted == turns;
        turns = wanted;
        plain_fringes.resize(wanted);
        amplitude_rad.resize(wanted + 1);
        rate_rad_s.resize(wanted + 1);
        b_rad_s.resize(wanted + 1);
        amplitude_change_rad.resize(amplitudes_change ? wanted + 1 : 0);
        coupling_phase_fringes.resize(phases_vary ? wanted + 1 : 0);
        rotation_fringes.resize(wanted);
        rotation_whole.resize(wanted);
    }
    /// +1 where turn i of the piece is a minimum, -1 where it is a maximum.
    int direction(std::size_t i) const { return (first_turn + static_cast<std::int64_t>(i)) % 2 == 0 ? 1 : -1; }
};

/// Half cycle `row` of the piece, which ends at turn `row`, as the gyro in that lane goes through it.
inline HalfCycle half_cycle_of(const Device& device, const LaneDrive& drive, std::size_t row, std::size_t lane) {
    HalfCycle half = device.half_cycle(-static_cast<double>(drive.direction(row)), drive.amplitude_rad[row][lane]);
    half.rate_rad_s = drive.rate_rad_s[row][lane];
    if (drive.amplitudes_change) half.amplitude_change_rad = drive.amplitude_change_rad[row][lane];
    return half;
}

/// The coupling over that half cycle.
inline Coupling coupling_of(const Device& device, const LaneDrive& drive, std::size_t row, std::size_t lane) {
    Coupling coupling = device.coupling;
    if (drive.phases_vary) coupling = coupling.moved_to(units::two_pi * drive.coupling_phase_fringes[row][lane]);
    coupling.b_rad_s = drive.b_rad_s[row][lane];
    return coupling;
}

/// State of the phase at these turns of the dither.
struct LaneTurns {
    /// [turns] of psi + coupling phase, that of the half cycle that ends at the turn.
    std::vector<simd::Lanes> cosine;
    std::vector<simd::Lanes> sine;
    std::vector<simd::Lanes> lockin_fringes;  ///< [turns] phase that the lock-in has added, beyond `lockin_whole`
    /// [turns] the same up to the middle of the half cycle that begins at the turn, in the frame in which fast motion
    /// is rotation, for the phase between turns. Filled where `middles` asks for it and the propagator knows them.
    std::vector<simd::Lanes> lockin_middle_fringes;
    bool middles = false;
    simd::Lanes lockin_whole;  ///< whole fringes that the lock-in had added when the piece began

    void resize(std::size_t turns) {
        lockin_middle_fringes.resize(middles ? turns : 0);
        cosine.resize(turns);
        sine.resize(turns);
        lockin_fringes.resize(turns);
    }
};

}  // namespace ringlock::gyro
