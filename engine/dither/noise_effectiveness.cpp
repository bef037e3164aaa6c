#include "engine/dither/noise_effectiveness.hpp"

#include <cmath>
#include <numbers>

#include "engine/core/units.hpp"
#include "engine/dither/followed_drift.hpp"
#include "engine/dither/operator_drift.hpp"
#include "engine/dither/phase_chain.hpp"
#include "engine/gyro/theory.hpp"

namespace ringlock::dither {

NoiseEffectiveness predict_noise_effectiveness(const gyro::Setup& setup, const InjectedTurns& noise) {
    using gyro::NoiseForm;
    NoiseEffectiveness found;
    found.input_rate_deg_h = setup.input_rate_deg_h;
    const double kick = gyro::turn_kick_rad(setup);
    const double depth = gyro::modulation_depth_rad(setup);
    PhaseChain chain;
    chain.r = std::sqrt(-std::expm1(-0.25 * kick * kick));
    chain.amplitude_rad = depth - 0.125 / depth - gyro::half_turn_delay_rad(setup);
    chain.half_cycle_rad = units::pi * setup.input_rate_deg_h /
                           (setup.scale_factor_arcsec * setup.dither_frequency_hz);  // [deg/h] is [arcsec/s]
    chain.rms_rad = noise.rms_rad;
    chain.level_rad = noise.rms_rad;
    found.change_per_cycle_rad = std::numbers::sqrt2 * noise.rms_rad;
    if (noise.drive) {
        const gyro::Resonator resonator(*noise.drive);
        found.change_per_cycle_rad = noise.rms_rad * resonator.change_per_cycle();
        chain.decay = resonator.step()(0, 0);
        if (noise.drive->form == NoiseForm::held) {
            chain.distribution = noise.drive->distribution;
            chain.hold_half_cycles = noise.drive->hold_half_cycles;
            chain.level_rad = noise.rms_rad / resonator.rms();
        } else {
            // The sum of 32 levels a half cycle is Gaussian, to a good approximation, for any distribution of the
            // levels.
            chain.level_rad = noise.rms_rad * std::sqrt((1.0 + chain.decay) / (1.0 - chain.decay));
        }
    }
    if (kick == 0.0) {
        found.bias_deg_h = 0.0;
        found.reason = "without lock-in there is no random walk";
        return found;
    }
    if (noise.rms_rad == 0.0) {
        found.reason = "no noise is injected";
        return found;
    }
    if (noise.drive && noise.drive->form == NoiseForm::sinusoidal) {
        const FollowedAngles angles = followed_angles(chain, setup, *noise.drive);
        found.angle_spread = angles.spread;
        found.reason = "a sinusoidal modulation is deterministic and makes no random walk";
        if (!angles.spread.empty()) found.bias_deg_h = angles.mean_rate_deg_h;
        return found;
    }
    std::optional<KickDrift> drift;
    if (chain.is_independent()) {
        drift = KickDrift{0.0, gyro::randomised_kick_variance_rad2(setup)};
    } else if (!noise.drive || (noise.drive->amplitude_loop_hz == 0.0 && comes_round(chain, setup))) {
        drift = operator_drift(chain);
    }
    if (!drift && noise.drive) drift = followed_drift(chain, setup, *noise.drive);
    if (!drift) {
        found.reason =
            "the phases hardly change from turn to turn, or the memory of the noise is too long: "
            "a prediction would take minutes";
        return found;
    }
    found.arw_over_theory = std::sqrt(drift->variance_rad2 / gyro::randomised_kick_variance_rad2(setup));
    found.bias_deg_h =
        drift->mean_kick_rad / units::two_pi * setup.scale_factor_arcsec * 2.0 * setup.dither_frequency_hz;
    return found;
}

}  // namespace ringlock::dither
