#pragma once
#include <cstdint>
#include <span>

#include "engine/gyro/device.hpp"
#include "engine/readout/lane_readings.hpp"

namespace ringlock::readout {

/// Pulses on both sides of a turn as if both belonged to one extremum.
///
/// The phase turns t_0 = -(rate + b sin x)/a away from the dither's turn, x the phase turned upright, within one of the
/// two half cycles. Pulses on the other side are those of the other half cycle's parabola, and with its acceleration a'
/// that stands still at t_0 a/a', by (t_0^2 a/2)(a/a' - 1) closer to them. With an asymmetric dither a/a' is 1 +- 4 r,
/// the same at all minima, and what takes all pulses for those of one extremum reads a phase that is wrong in step with
/// sin x: a bias (docs/readout.md). All of t_0 is known well enough: b as told, x as sampled, the rate as the mean of
/// the readings so far. What a second harmonic of the dither does to t_0 is not taken into account.
class PulseAlignment {
   public:
    /// \param devices as the electronics know them: amplitude, durations, coupling
    explicit PulseAlignment(std::span<const gyro::Device> devices);

    /// Moves the times of the pulses on the side on which the extremum does not lie; consecutive readings, as sampled.
    void align(LaneReadings& readings);

    struct Known {
        simd::Lanes acceleration_rad_s2[2][2];  ///< [minimum, maximum][before, after]
        simd::Lanes b_rad_s, turn_asymmetry;
        simd::Lanes coupling_sine, coupling_cosine;
        simd::Lanes second_ratio, second_sine, second_cosine;
        simd::Lanes inverse_period_s;
    };
    struct State {
        simd::Lanes last_fringes{}, last_whole{}, last_gain{};
        simd::Lanes cycle_gain{};  ///< mean of the phase gained in a cycle [fringes]
        simd::Lanes cycles{};
        std::int64_t turns = 0;
    };

   private:
    std::size_t lanes_;
    bool asymmetric_ = false;  ///< some gyro: with the others nothing moves
    Known known_;
    State state_;
};

}  // namespace ringlock::readout
