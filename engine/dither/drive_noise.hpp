#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/gyro/device.hpp"
#include "engine/gyro/resonator.hpp"
#include "engine/random/normal_lanes.hpp"

namespace ringlock::dither {

/// Angles and times of the turns of a block of gyros whose drives are noisy: the exact motion of their resonators.
///
/// A turn is where the velocity vanishes next to the nominal turn; its angle is that of the case there. The force is
/// constant over a half cycle from nominal turn to nominal turn (`held`), over 1/32 of it (`white`), or modulated by a
/// sinusoid; the amplitude loop, where there is one, adds to it from the next nominal turn on. Runs begin in the
/// stationary state.
class DriveNoiseLanes {
   public:
    /// `rms_rad`: stationary standard deviation of the amplitude at the turns [rad of optical phase].
    DriveNoiseLanes(const gyro::DriveNoise& noise, std::span<const gyro::Device> devices, double rms_rad,
                    const random::LaneIdentities& who);

    /// Deviation of the amplitude at the turn that was reached last, and of that turn's time; at first of turn 0, and
    /// of the turn before it.
    const simd::Lanes& deviation_rad() const { return state_.deviation_rad; }
    const simd::Lanes& before_rad() const { return before_rad_; }
    const simd::Lanes& late_s() const { return state_.late_s; }

    /// The next turns: how far the amplitude at each is from the device's [rad], and how late it is [s].
    void next(std::size_t turns, std::vector<simd::Lanes>& deviation_rad, std::vector<simd::Lanes>& late_s);

    /// Levels of the force of the half cycle that begins at a nominal turn, as amplitudes that they would come to
    /// [rad]: one, or white_levels of them. The loop's share is not among them.
    std::vector<double> levels_rad(std::size_t lane, std::int64_t turn) const;

    /// State of each gyro at a turn.
    struct State {
        simd::Lanes amplitude_rad{};                 ///< without noise
        simd::Lanes u_rad{}, q_rad{};                ///< at the nominal turn
        simd::Lanes forced_u_rad{}, forced_q_rad{};  ///< by a sinusoidal modulation, there
        simd::Lanes loop_rad{};                      ///< the loop's force from the nominal turn on
        simd::Lanes ending_loop_rad{};               ///< and up to there
        simd::Lanes deviation_rad{}, late_s{};       ///< at the turn itself
    };

   private:
    /// The force over one half cycle, for all gyros.
    struct Levels {
        std::vector<simd::Lanes> rad;  ///< one row, or white_levels of them; `sinusoidal`: none
    };

    Levels levels_of(std::int64_t turn) const;
    /// Levels of the turn after that of `last`, in less time.
    void levels_after(const Levels& last, std::int64_t turn, Levels& levels);
    void advance();
    void place_turns();
    void place_turns_among_levels(double per_rad_s);

    gyro::DriveNoise noise_;
    gyro::Resonator resonator_;
    std::size_t lanes_;
    random::LaneIdentities who_;
    double level_rad_;   ///< rms
    std::int64_t turn_;  ///< reached last; negative before the run
    std::int64_t first_turn_;
    std::array<std::int64_t, simd::lanes> hold_phase_{};
    simd::Lanes modulation_phase_rad_{};
    State state_;
    simd::Lanes before_rad_{};
    std::vector<simd::Lanes> drawn_;  ///< deviates of some half cycles, for levels that are drawn at every turn
    std::uint64_t drawn_from_ = 0;
    Levels ending_, beginning_;  ///< of the half cycle that ends at the turn and of that which begins there
};

}  // namespace ringlock::dither
