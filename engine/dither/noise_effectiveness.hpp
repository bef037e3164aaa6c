#pragma once
#include <optional>
#include <string>
#include <vector>

#include "engine/gyro/resonator.hpp"
#include "engine/gyro/setup.hpp"

/// How well noise on the dither randomises the phase at the turns, predicted without simulation.
///
/// The phase at the turns and the dither's amplitude are a Markov chain: the amplitude goes on as the resonator and the
/// levels of its drive make it, and each turn adds a kick to the phase that depends on the phase alone. Mean and
/// long-term variance of the sum of the kicks follow from the chain's transfer operator (docs/noise-injection.md).
namespace ringlock::dither {

/// Noise that is injected into the dither.
struct InjectedTurns {
    std::optional<gyro::DriveNoise> drive;  ///< empty: turns' angles are Gaussian and independent of each other
    double rms_rad = 0.0;                   ///< standard deviation of the amplitude at the turns [rad of optical phase]
};

/// Standard deviation, over gyros of unknown phase, of the angle that the lock-in has added some time after the start.
struct AngleSpread {
    double after_s = 0.0;
    double arcsec = 0.0;
};

struct NoiseEffectiveness {
    double input_rate_deg_h = 0.0;
    /// Rms change of the amplitude from a turn to the next but one [rad of optical phase].
    double change_per_cycle_rad = 0.0;
    /// Angle random walk over that of randomised turns (gyro::randomised_arw_deg_rt_h).
    std::optional<double> arw_over_theory;
    std::optional<double> bias_deg_h;       ///< mean output rate less the input rate
    std::vector<AngleSpread> angle_spread;  ///< where there is no random walk
    std::string reason;                     ///< why there is no random walk, or no prediction
};

/// Predicts the effect of the noise on one gyro: its lock-in by the exact turn map at its mean amplitude, equal half
/// cycles, a steady input. Where the transfer operator is too large, under an amplitude loop, and for a sinusoid, the
/// chain itself is followed: the random walk then has an error of 1 %. A prediction that would take more than some ten
/// seconds is left out, and `reason` says so.
NoiseEffectiveness predict_noise_effectiveness(const gyro::Setup& setup, const InjectedTurns& noise);

/// Times at which AngleSpread is computed [s].
inline constexpr double spread_times_s[] = {1.0, 10.0, 100.0};

}  // namespace ringlock::dither
