#pragma once
#include <array>
#include <span>

#include "engine/gyro/device.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::readout {

/// Where the comparators of one gyro switch, by the number of the quarter fringe modulo 4 (0: sin psi rises through
/// zero, 1: cos psi falls): psi there less the quarter fringe's own [rad], and the fringe amplitude of that detector.
struct ComparatorPoints {
    std::array<double, 4> shift_rad{};
    std::array<double, 4> amplitude{};
};
ComparatorPoints comparator_points(const gyro::Ellipse& ellipse);

/// Constants of a block of gyros for the readout kernels; index 0 of a pair: half cycles of positive sign.
struct ReadoutConstants {
    simd::Lanes angular_frequency_rad_s[2];
    simd::Lanes duration_s[2];
    simd::Lanes scale_s[2];   ///< unit of time of the path near a turn
    simd::Lanes scale_angle;  ///< angular frequency times that
    simd::Lanes harmonic_ratio, harmonic_sine, harmonic_cosine;
    simd::Lanes turn_asymmetry;
    simd::Lanes second_ratio, second_sine, second_cosine;  ///< second harmonic of the coupling, in psi + its phase
    simd::Lanes coupling_cosine, coupling_sine;            ///< of the coupling phase
    simd::Lanes coupling_phase_fringes;
    simd::Lanes gain, offset_sin, offset_cos, orthogonality_cosine, orthogonality_sine;
    simd::Lanes swing_whole;  ///< whole fringes between minima and maxima that the drive's phases leave out
    simd::Lanes comparator_shift_rad[4];
    simd::Lanes comparator_amplitude[4];
    bool extras = false;  ///< some gyro has a second harmonic, or unequal turns
};

/// \param devices   of each gyro, at most simd::lanes; the last one stands for lanes beyond
/// \param ellipses  errors of each gyro's detectors
ReadoutConstants make_readout_constants(std::span<const gyro::Device> devices, std::span<const gyro::Ellipse> ellipses);

}  // namespace ringlock::readout
