#pragma once
#include <span>

#include "engine/simd/lanes.hpp"

namespace ringlock::readout {

/// Pulses on either side of a turn that the counter keeps.
inline constexpr std::size_t kept_pulses = 4;

/// Properties of the electronics.
struct Electronics {
    bool ideal = false;                           ///< exact phase and acceleration at every zero-rate point
    bool interpolate = true;                      ///< angle from count and quadrature; otherwise whole quarter fringes
    double clock_hz = 0.0;                        ///< pulses are timed in whole ticks; 0: continuous
    double detector_noise_relative = 0.0;         ///< rms of each detector sample over the fringe amplitude
    double comparator_noise_relative = 0.0;       ///< the same of the comparators' inputs when they switch
    double comparator_hysteresis_relative = 0.0;  ///< comparators switch this far beyond zero in either direction
    double detector_bandwidth_hz = 0.0;           ///< first-order low-pass of detectors and comparators; 0: unlimited
    int adc_bits = 0;                             ///< of +-adc_range fringe amplitudes; 0: continuous

    static constexpr double adc_range = 1.25;
};

/// Random numbers of the electronics, the same for all trajectories of a block; empty for electronics without noise.
/// They are standard normal deviates except those of the counters.
struct ElectronicNoise {
    std::span<const simd::Lanes> detectors = {};  ///< [2 turn + detector][gyro]: sine, cosine
    /// [2 kept_pulses turn + kept_pulses side + pulse][gyro]: before, after the turn; nearest pulse first
    std::span<const simd::Lanes> comparators = {};
    std::span<const simd::Lanes> count_errors = {};  ///< [turn][gyro]: count less the true one, quarter fringes
};

}  // namespace ringlock::readout
