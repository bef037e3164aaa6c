#pragma once
#include <cstdint>
#include <vector>

#include "engine/gyro/resonator.hpp"

namespace ringlock::dither {

/// The Markov chain of slow phase and amplitude at the turns of one gyro with noise on its dither: its constants.
///
/// The slow phase is the optical phase less that of the dither. The input rotates it from turn to turn, and each turn
/// adds a kick that depends on the optical phase alone. The amplitude follows the levels of the drive like a resonator.
struct PhaseChain {
    double r = 0.0;               ///< |z| of a turn's Moebius map
    double amplitude_rad = 0.0;   ///< M less the delays by lock-in and by the finite swing
    double half_cycle_rad = 0.0;  ///< rotation of the input over a half cycle
    double rms_rad = 0.0;         ///< standard deviation of the amplitude at the turns
    double decay = 0.0;           ///< factor by which a deviation of the amplitude decays over a half cycle
    double level_rad = 0.0;       ///< rms of the amplitude that a constant level would lead to
    std::int64_t hold_half_cycles = 1;
    gyro::NoiseDistribution distribution = gyro::NoiseDistribution::gaussian;

    /// Change of the amplitude over a hold that a level of one standard deviation makes.
    double reach_rad() const;
    /// Largest deviation of the amplitude that is considered.
    double largest_rad() const;
    /// Whether successive turns are independent: Gaussian levels of one half cycle move the amplitude so far that the
    /// phases are correlated by exp(-reach^2/2) < 1e-13.
    bool is_independent() const;
};

/// Mean and long-term variance of a kick.
struct KickDrift {
    double mean_kick_rad = 0.0;
    double variance_rad2 = 0.0;
};

/// A level of the drive, in standard deviations, and its probability.
struct DriveLevel {
    double value = 0.0;
    double weight = 0.0;
};

/// Number of drive_levels().
double drive_level_count(const PhaseChain& chain);
/// Levels that represent the distribution: as many as resolve waves of four periods a radian of amplitude.
std::vector<DriveLevel> drive_levels(const PhaseChain& chain);

}  // namespace ringlock::dither
