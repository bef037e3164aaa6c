#pragma once
#include <array>
#include <cstdint>

#include "engine/gyro/setup.hpp"
#include "engine/readout/lane_readings.hpp"

namespace ringlock::readout {

/// Learns the ellipse on which the detectors' pairs (s, c) lie, and makes it a circle (Heydemann, Applied Optics 20,
/// 3382, 1981): with s = (1 + g) sin psi + o_s and c = cos(psi + e) + o_c the conic
///
///     A s^2 + B s c + C c^2 + D s + E c = 1
///
/// has its centre in (o_s, o_c), and 1 + g = sqrt(C/A), sin e = B/(2 sqrt(A C)). A...E are fitted by least squares to
/// all readings so far, older ones with the weight exp(-turns since/65536). Made-up readings on the unit
/// circle, eight and a thousandth of all, keep the fit where phases do not move, as in a locked gyro; they hide a
/// thousandth of the ellipse.
///
/// The noise of the detectors makes the ellipse larger by its variance, and leaves its centre and shape.
class EllipseCorrection {
   public:
    explicit EllipseCorrection(std::size_t lanes);

    /// Corrects sine, cosine and phase_fringes of consecutive readings, and the angle output where `interpolated`;
    /// gives the pulses the phases at which the comparators are known to switch.
    void correct(LaneReadings& readings, LaneAngles& angles, bool interpolated);

    /// As known by now.
    const gyro::Ellipse& ellipse(std::size_t lane) const { return known_[lane]; }

    struct State {
        simd::Lanes sums[20]{};  ///< products of (s^2, s c, c^2, s, c) by pairs, then these
        simd::Lanes gain, offset_sin{}, offset_cos{}, orthogonality_sine{}, orthogonality_cosine;
    };

   private:
    void fit();

    std::size_t lanes_;
    State state_;
    std::array<gyro::Ellipse, simd::lanes> known_;
    std::array<simd::Lanes, 4> known_shift_rad_{};  ///< of the comparators
    std::int64_t turns_ = 0;
    std::int64_t next_fit_;
};

}  // namespace ringlock::readout
