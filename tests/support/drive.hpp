#pragma once
#include <cstdint>

#include "engine/gyro/device.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::test {

/// The dither of one gyro, turn after turn: a sinusoid with asymmetry, and optionally random noise on the dither angle
/// at each turn. Noise is on the angle, not on the rate: the case swings between noisy turns and stays where it is.
///
/// Turn 0 is a phase minimum. Phases are in radians of optical phase, counted from the noise-free first turn.
class Drive {
   public:
    /// `turn_phase_rms_rad` 0 means no noise.
    Drive(const gyro::Device& device, double turn_phase_rms_rad, random::Identity who);

    /// Dither phase at the current turn.
    double turn_phase_rad() const { return nominal_rad() + noise_rad_; }
    /// +1 at a phase minimum, -1 at a maximum.
    int direction() const { return turn_ % 2 == 0 ? 1 : -1; }
    /// Nominal time of the current turn [s].
    double time_s() const;
    std::int64_t turn() const { return turn_; }
    /// The half cycle that ends at the current turn; before turn 0 the drive is free of noise.
    gyro::HalfCycle before() const { return before_; }
    /// The half cycle that begins at the current turn.
    gyro::HalfCycle after() const { return after_; }
    /// Goes on to the next turn.
    void advance();

    /// Lowest and highest amplitude of a half cycle that noise of this rms can ask for, but for one in 1e15.
    static double amplitude_margin_rad(double turn_phase_rms_rad);

   private:
    double nominal_rad() const { return turn_ % 2 == 0 ? 0.0 : 2.0 * device_.dither_amplitude_rad; }
    double noise_at(std::int64_t turn);
    gyro::HalfCycle make_after() const;

    gyro::Device device_;
    double rms_rad_;
    random::Identity who_;
    std::int64_t turn_ = 0;
    double noise_rad_ = 0.0;
    double next_noise_rad_ = 0.0;
    gyro::HalfCycle before_;
    gyro::HalfCycle after_;
};

}  // namespace ringlock::test
