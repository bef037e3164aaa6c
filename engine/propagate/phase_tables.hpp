#pragma once
#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/gyro/device.hpp"
#include "engine/propagate/chebyshev.hpp"
#include "engine/propagate/turn_tables.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::propagate {

/// Half turns of a block of gyros whose coupling may have a second harmonic: Fourier series in the phase with
/// coefficients that are polynomials in amplitude, rate and coupling.
///
/// In the frame of fast_frame.hpp the phase moves between a turn (theta, with the coupling phase) and the middle of the
/// half cycle (u: phi and half the plain phase added or taken) by
///
///     u = theta + begin(theta),      theta = u + shift + end(u + shift),
///
/// each with functions of its own for the two signs of half cycles. The shift, the mean of the way back, is taken out
/// of the angle because it may be large and grow with the amplitude. The nodes are integrated through every fringe,
/// with integrate(). The series of a gyro depend on its device and ranges alone. Derived in docs/dev/turn-map.md.
class PhaseTables {
   public:
    static constexpr std::size_t variables = 3;
    static constexpr std::size_t most_nodes = 24;
    static constexpr std::size_t most_harmonics = 32;

    /// Coefficient of exp(i k angle): value = Re sum_k c_k exp(i k angle) in fringes. The imaginary part of that of k =
    /// 0, which does not count there, is the shift of an end 1.
    struct Harmonic {
        /// Terms in each variable: the largest number of any gyro, others have zeros.
        Terms terms = one_term;
        /// [coupling][rate][amplitude][Re, Im], powers of the variables scaled to [-1, 1].
        std::vector<simd::Lanes> coefficients;
    };
    /// One end of half cycles of one sign, from k = 0 on.
    using Part = std::vector<Harmonic>;

    /// `tolerance_rad`: error of a turn.
    explicit PhaseTables(double tolerance_rad) : tolerance_rad_(tolerance_rad) {}

    /// Makes the series of one gyro. Throws RunError where the tolerance cannot be held, and where a half cycle has no
    /// fast middle.
    void make(std::size_t lane, const gyro::Device& device, const HalfCycleRanges& ranges);

    /// End 0: from the turn at which the half cycle begins to its middle. End 1: from its middle to the next turn.
    const Part& part(double sign, int end) const { return parts_[index(sign, end)]; }
    /// Middle and inverse half width of the ranges, 0 for variables that do not vary.
    const std::array<simd::Lanes, variables>& centre() const { return centre_; }
    const std::array<simd::Lanes, variables>& inverse_half_width() const { return inverse_; }
    const HalfCycleRanges& ranges(std::size_t lane) const { return ranges_[lane]; }
    /// Largest error of a turn of that gyro, against the equation integrated through every fringe of the half turns,
    /// between the nodes and between the phases of all its tables so far [rad].
    double measured_error_rad(std::size_t lane) const { return error_rad_[lane]; }
    /// Times that a gyro's were made.
    std::int64_t made() const { return made_; }
    /// Largest number of terms in any variable.
    std::size_t nodes() const;
    /// Largest number of harmonics of any gyro.
    std::size_t harmonics() const;

    /// Series of one part of one gyro.
    struct LanePart {
        Terms terms = one_term;
        std::size_t harmonics = 0;
        /// [coupling][rate][amplitude][k], k from 0 to harmonics.
        std::vector<std::complex<double>> coefficients;
    };

   private:
    static std::size_t index(double sign, int end) { return (sign > 0 ? 0U : 2U) + static_cast<std::size_t>(end); }
    void lay_out(std::size_t part);

    double tolerance_rad_;
    std::int64_t made_ = 0;
    std::array<Part, 4> parts_;
    std::array<std::array<LanePart, simd::lanes>, 4> lane_parts_;
    std::array<simd::Lanes, variables> centre_;
    std::array<simd::Lanes, variables> inverse_;
    std::array<HalfCycleRanges, simd::lanes> ranges_{};
    std::array<double, simd::lanes> error_rad_{};
};

}  // namespace ringlock::propagate
