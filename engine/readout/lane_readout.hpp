#pragma once
#include <span>
#include <vector>

#include "engine/gyro/device.hpp"
#include "engine/gyro/lane_drive.hpp"
#include "engine/random/normal_lanes.hpp"
#include "engine/readout/lane_readings.hpp"
#include "engine/readout/pulse_tables.hpp"

/// From the true phase to what the electronics report.
namespace ringlock::readout {

/// Properties of the electronics.
struct Electronics {
    bool ideal = false;                    ///< exact phase and acceleration at every zero-rate point
    bool interpolate = true;               ///< angle from count and quadrature; otherwise whole quarter fringes
    double clock_hz = 0.0;                 ///< pulses are timed in whole ticks; 0: continuous
    double detector_noise_relative = 0.0;  ///< rms of each detector sample over the fringe amplitude
};

/// The same noise for all trajectories of a block: deviates of both detectors at each turn, [2 turn + detector][gyro].
using DetectorNoise = std::span<const simd::Lanes>;

/// Readout of a block of gyros.
///
/// The dither turns at its own zero-rate point; the phase turns where input rate and lock-in are added, a little before
/// or after. From the dither's turn the phase's is found by Taylor series of the equation of motion, in as many steps
/// as it takes; pulses next to it come from PulseTables.
class LaneReadout {
   public:
    /// \param devices     of each gyro, at most simd::lanes; with b = 0 where there is no lock-in
    /// \param ellipses    errors of each gyro's detectors; not used by ideal electronics
    /// \param with_pulses accelerations are wanted, from pulses unless the electronics are ideal
    LaneReadout(std::span<const gyro::Device> devices, std::span<const gyro::Ellipse> ellipses,
                const Electronics& electronics, bool with_pulses);

    /// Reads every `stride`-th turn of the piece, from the first; rows of turns in between are left as they are.
    /// `noise` is empty where the electronics have none. Throws RunError where the phase does not reverse near a turn.
    void read(const gyro::LaneDrive& drive, const gyro::LaneTurns& turns, DetectorNoise noise, std::size_t stride,
              LaneReadings& readings, LaneAngles& angles) const;

    /// What the kernel needs, one value for each gyro; index 0 of a pair: half cycles of positive sign.
    struct Constants {
        simd::Lanes angular_frequency_rad_s[2];
        simd::Lanes duration_s[2];
        simd::Lanes harmonic_ratio, harmonic_sine, harmonic_cosine;
        simd::Lanes turn_asymmetry;
        bool second = false;  ///< some coupling has a second harmonic: ratio times cosine and sine of its phase
        simd::Lanes second_sine, second_cosine;
        simd::Lanes coupling_cosine, coupling_sine;  ///< of the coupling phase
        simd::Lanes gain, offset_sin, offset_cos, orthogonality_cosine, orthogonality_sine;
        simd::Lanes swing_whole;  ///< whole fringes between minima and maxima that the drive's phases leave out
    };

   private:
    std::size_t lanes_;
    Electronics electronics_;
    bool with_accelerations_;
    Constants constants_;
    PulseTables pulses_;
};

}  // namespace ringlock::readout
