#pragma once
#include <array>
#include <optional>
#include <vector>

#include "engine/dither/noise_effectiveness.hpp"
#include "engine/dither/phase_chain.hpp"
#include "engine/gyro/resonator.hpp"
#include "engine/gyro/setup.hpp"

namespace ringlock::dither {

/// Time after which a random walk is read from an Allan deviation [s].
inline constexpr double walk_read_after_s = 32.0;

/// Whether the slow phase takes all values within `walk_read_after_s`, by the input's rotation or by the kicks.
/// Otherwise the walk that is seen is a mean over gyros that differ, and not that of infinite time.
bool comes_round(const PhaseChain& chain, const gyro::Setup& setup);

/// Mean and long-term variance of the kicks from 512 gyros that are followed along the chain with the exact motion of
/// their resonators: an error of 1 % of the random walk. Nothing where that takes more than some ten seconds.
std::optional<KickDrift> followed_drift(const PhaseChain& chain, const gyro::Setup& setup,
                                        const gyro::DriveNoise& noise);

/// Angles under a sinusoidal modulation, which are deterministic: over 256 gyros of different phases.
struct FollowedAngles {
    std::vector<AngleSpread> spread;  ///< after those of spread_times_s that take no more than some ten seconds
    double mean_rate_deg_h = 0.0;     ///< of the lock-in, over the longest of these times
};
FollowedAngles followed_angles(const PhaseChain& chain, const gyro::Setup& setup, const gyro::DriveNoise& noise);

}  // namespace ringlock::dither
