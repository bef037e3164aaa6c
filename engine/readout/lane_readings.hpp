#pragma once
#include <cstdint>
#include <vector>

#include "engine/readout/electronics.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::readout {

/// Times of the comparators' pulses next to consecutive turns, as the counter's clock sees them.
struct LanePulses {
    /// From the instant at which the detectors were sampled, in the direction of time [s]; 0 where that pulse was not
    /// distinguished from its neighbour beyond the turn. [before, after][nearest first][turn]
    std::vector<simd::Lanes> time_s[2][kept_pulses];
    /// Number of the quarter fringe of the nearest pulses, counted upright: the phase itself at minima, its negative at
    /// maxima; in quarter fringes, on the branch of phase_fringes. [turn]
    std::vector<simd::Lanes> first_quarter;
    /// Phase at which comparators are known to switch less the quarter fringe's own, by its number modulo 4; empty
    /// where nothing is known of the detectors' ellipse. [number][turn]
    std::vector<simd::Lanes> known_shift_rad[4];

    void resize(std::size_t wanted) {
        for (auto& side : time_s) {
            for (auto& column : side) column.resize(wanted);
        }
        first_quarter.resize(wanted);
    }
    bool empty() const { return first_quarter.empty(); }
};

/// Readings of the electronics at consecutive zero-rate points of a block of gyros: one row a turn, one column a gyro.
/// Even turns of a run are minima of the phase. These are the only data that compensators receive.
struct LaneReadings {
    std::int64_t first_turn = 0;
    std::size_t turns = 0;
    std::vector<simd::Lanes> sine;  ///< quadrature detectors
    std::vector<simd::Lanes> cosine;
    /// Unwrapped phase: the quadrature's on the branch nearest to the middle of the quarter fringe that the counter
    /// names (wrong by whole fringes where it has missed counts); fringes, less ...
    std::vector<simd::Lanes> phase_fringes;
    std::vector<simd::Lanes> phase_whole;  ///< ... these whole ones
    /// Magnitude of the phase acceleration on either side; 0 where no two pulses were distinguished.
    std::vector<simd::Lanes> accel_before_rad_s2;
    std::vector<simd::Lanes> accel_after_rad_s2;
    LanePulses pulses;  ///< empty unless requested
    // For records; empty unless requested:
    std::vector<simd::Lanes>
        zero_rate_s;                 ///< when the phase turned, as the electronics find it, from the dither's turn
    std::vector<simd::Lanes> count;  ///< count of the counter, in quarter fringes, less those of phase_whole

    void resize(std::size_t wanted) {
        turns = wanted;
        for (auto* column : {&sine, &cosine, &phase_fringes, &phase_whole, &accel_before_rad_s2, &accel_after_rad_s2}) {
            column->resize(wanted);
        }
    }
    bool minimum(std::size_t i) const { return (first_turn + static_cast<std::int64_t>(i)) % 2 == 0; }
};

/// The same turns as they are, for scoring.
struct LaneAngles {
    /// Angle output of the gyro with the dither stripped, in fringes of rotation: case, lock-in and reading error; less
    /// the whole fringes below.
    std::vector<simd::Lanes> angle_fringes;
    std::vector<simd::Lanes> angle_whole;
    /// Lock-in error at the zero-rate point, less the whole fringes below.
    std::vector<simd::Lanes> lockin_fringes;
    simd::Lanes lockin_whole;
    // Empty unless requested:
    std::vector<simd::Lanes> phase_fringes;  ///< at the zero-rate point, less the whole ones of LaneReadings
    std::vector<simd::Lanes> zero_rate_s;    ///< when the phase turns, from the dither's turn

    void resize(std::size_t wanted) {
        angle_fringes.resize(wanted);
        angle_whole.resize(wanted);
        lockin_fringes.resize(wanted);
    }
};

}  // namespace ringlock::readout
