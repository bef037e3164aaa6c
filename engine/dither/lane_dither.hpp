#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/dither/drive_noise.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/lane_drive.hpp"
#include "engine/random/normal_lanes.hpp"

namespace ringlock::dither {

/// Change of the amplitude at a turn at time t, relative: drift t + W(t), W a random walk of variance wander^2 t.
struct Wander {
    double relative_rt_s = 0.0;
    double drift_relative_per_s = 0.0;

    bool active() const { return relative_rt_s != 0.0 || drift_relative_per_s != 0.0; }
};

/// Drive of a block of gyros, piece after piece: the dither, optionally with random noise on its angle at each turn,
/// and the rotation of the case.
///
/// Noise is on the angle, not on the rate: the case swings between noisy turns and stays where it is. It is independent
/// from turn to turn, and the drive is free of it before turn 0; or it is that of a resonator whose force is noisy
/// (DriveNoiseLanes), which has memory and was there before. The amplitude can drift and wander: turns are then farther
/// out, or less far. Rates that vary in time are constant over each half cycle: at their mean.
class LaneDither {
   public:
    /// `devices`: the device of each gyro, at most simd::lanes. `noise_rms_rad`: rms of the noise of each turn's angle
    /// in optical phase; 0: no noise.
    LaneDither(std::span<const gyro::Device> devices, double noise_rms_rad, const random::LaneIdentities& who,
               const Wander& wander = {});
    /// With the noise of a drive, of that stationary rms of the amplitude at the turns.
    LaneDither(std::span<const gyro::Device> devices, const gyro::DriveNoise& noise, double noise_rms_rad,
               const random::LaneIdentities& who, const Wander& wander = {});

    /// Fills in the next `turns` turns. `extra_angle_arcsec`: rotation by varying rates over the half cycle that begins
    /// at each of them, [turn][gyro], or empty; the half cycle's mean rate grows by it. `threshold_factor`: b of these
    /// half cycles over the device's, or empty. `coupling_phase_rad`: phase by which the coupling moves over them from
    /// the device's, or empty.
    void next(std::size_t turns, std::span<const simd::Lanes> extra_angle_arcsec,
              std::span<const simd::Lanes> threshold_factor, gyro::LaneDrive& drive,
              std::span<const simd::Lanes> coupling_phase_rad = {});

    /// Constants of the kernel, one value for each gyro; index 0 of a pair: half cycles of positive sign.
    struct Constants {
        simd::Lanes amplitude_rad, input_rate_rad_s, b_rad_s, coupling_phase_fringes;
        simd::Lanes start_fringes[2];  ///< phase at minima and maxima without noise and rotation
        simd::Lanes turn_fringes[2];   ///< rotation of the input over a half cycle, less ...
        simd::Lanes turn_whole[2];     ///< ... these whole fringes
        simd::Lanes fringes_per_arcsec;
        simd::Lanes rate_per_arcsec[2];  ///< mean phase rate of 1 arcsec over a half cycle [rad/s]
        simd::Lanes duration_s[2];
    };
    struct State {
        simd::Lanes rotation_fringes, rotation_whole;
        simd::Lanes noise_rad;  ///< at the next turn
        // Of the half cycle that ends there:
        simd::Lanes amplitude_rad, rate_rad_s, b_rad_s, coupling_phase_fringes;
    };

   private:
    /// Turns' offsets by a noisy drive in place of deviates.
    void take_drive_noise(std::size_t turns);
    /// Adds the parts of the drive that the kernel does not compute: changes of the amplitude, and delays of late
    /// turns.
    void finish_drive(gyro::LaneDrive& drive);
    /// Turns the noise, one deviate a turn, into the deviations of the turns: noise and change of the amplitude [rad].
    void add_wander();

    std::size_t lanes_;
    double noise_rms_rad_;
    random::LaneIdentities who_;
    Constants constants_;
    State state_;
    std::int64_t turn_ = 0;
    std::vector<simd::Lanes> deviates_;
    Wander wander_;
    simd::Lanes walk_{};  // W at the last turn
    std::vector<simd::Lanes> steps_;
    std::unique_ptr<DriveNoiseLanes> resonator_;
    bool amplitudes_change_ = false;
    std::vector<simd::Lanes>
        deviation_rad_;  // of the amplitude at the turns from the piece's first on, and the one after
    std::vector<simd::Lanes> late_s_;
    simd::Lanes before_rad_{};                 // at the turn before the piece
    simd::Lanes turned_before_fringes_{};      // by the input while that turn was late
    const gyro::LaneDrive* filled_ = nullptr;  // has this dither's rates and couplings, if they are constant
};

}  // namespace ringlock::dither
