#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/gyro/device.hpp"
#include "engine/propagate/chebyshev.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::propagate {

/// Values that a quantity of the half cycles takes.
struct Range {
    double lowest = 0.0;
    double highest = 0.0;

    bool covers(double value) const { return value >= lowest && value <= highest; }
};

/// Ranges of the quantities that may differ from half cycle to half cycle of one gyro.
struct HalfCycleRanges {
    Range amplitude_rad;  ///< at the turn; the half cycle's own where it does not change
    Range rate_rad_s;
    Range b_rad_s;
    Range amplitude_change_rad{};  ///< over a half cycle; symmetric about zero
};

/// The exact half turns of a block of gyros as polynomials in amplitude, rate, coupling and change of the amplitude.
///
/// Each gyro has its own polynomials over its own ranges, of as many terms as hold the error measured between the
/// nodes; a quantity that does not vary takes one term. The polynomials of a gyro depend on its device and ranges
/// alone.
class TurnTables {
   public:
    static constexpr std::size_t variables = 4;
    static constexpr std::size_t most_nodes = 32;

    /// Polynomials of the half turns at one end of half cycles of one sign.
    struct Part {
        /// Terms in each variable: the largest number of any gyro, others have zeros.
        Terms terms = one_term;
        /// [change][coupling][rate][amplitude][shift in fringes, Re z, Im z], powers of the variables scaled to [-1,
        /// 1].
        std::vector<simd::Lanes> coefficients;
        /// [change][coupling][rate]: terms in the amplitude beyond which all gyros have zeros.
        std::vector<std::size_t> amplitude_terms;
    };

    /// `tolerance_rad`: interpolation error of a turn.
    explicit TurnTables(double tolerance_rad) : tolerance_rad_(tolerance_rad) {}

    /// Makes the polynomials of one gyro. Throws RunError where the tolerance cannot be held, and where the coupling
    /// has a second harmonic: such half turns are no Moebius maps.
    void make(std::size_t lane, const gyro::Device& device, const HalfCycleRanges& ranges);

    /// End 0: from the turn at which the half cycle begins to its middle. End 1: from its middle to the next turn.
    const Part& part(double sign, int end) const { return parts_[index(sign, symmetric_ ? 0 : end)]; }
    /// Both ends are alike for all gyros.
    bool symmetric() const { return symmetric_; }
    /// Amplitudes change over half cycles of some gyro.
    bool changing() const { return changing_; }
    /// Lock-in may turn some gyro's phase by more than a quarter fringe at a turn.
    bool strong() const { return strong_; }
    /// Middle and inverse half width of the ranges, 0 for variables that do not vary.
    const std::array<simd::Lanes, variables>& centre() const { return centre_; }
    const std::array<simd::Lanes, variables>& inverse_half_width() const { return inverse_; }
    const HalfCycleRanges& ranges(std::size_t lane) const { return ranges_[lane]; }
    /// Largest interpolation error of a turn of that gyro, measured between the nodes of all its tables so far [rad].
    double measured_error_rad(std::size_t lane) const { return error_rad_[lane]; }
    /// Times that a gyro's were made.
    std::int64_t made() const { return made_; }
    /// Largest number of terms in any variable.
    std::size_t nodes() const;

   private:
    static std::size_t index(double sign, int end) { return (sign > 0 ? 0U : 2U) + static_cast<std::size_t>(end); }
    void put(Part& part, std::size_t lane, const Terms& terms, const std::vector<std::array<double, 3>>& coefficients);

    double tolerance_rad_;
    std::int64_t made_ = 0;
    bool symmetric_ = true;
    bool strong_ = false;
    bool changing_ = false;
    std::array<Part, 4> parts_;
    std::array<simd::Lanes, variables> centre_;
    std::array<simd::Lanes, variables> inverse_;
    std::array<HalfCycleRanges, simd::lanes> ranges_{};
    std::array<double, simd::lanes> error_rad_{};
};

}  // namespace ringlock::propagate
