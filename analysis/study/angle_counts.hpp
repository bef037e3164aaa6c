#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/ensemble/output_counts.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/simd/lanes.hpp"

/// From an arm's counts, which wrap round, to its angle. Code that simulates a gyro again uses the same conversion, so
/// that angles are the same to the bit.
namespace ringlock::study {

/// Counts that do not wrap round.
__extension__ using WideCounts = __int128;

/// Angle output of a block of gyros since the start of a record.
class AngleCounts {
   public:
    /// The record begins: its first angle is stored as it is; later angles follow from differences.
    void start(const simd::LaneCounts& row) {
        last_ = origin_ = row;
        turned_ = {};
    }
    /// Goes on to another angle, less than 2^31 fringes away.
    void turn_to(const simd::LaneCounts& row) {
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            turned_[lane] += static_cast<std::int64_t>(static_cast<std::uint64_t>(row[lane]) -
                                                       static_cast<std::uint64_t>(last_[lane]));
        }
        last_ = row;
    }

    /// Turned since the start.
    WideCounts turned(std::size_t lane) const { return turned_[lane]; }
    /// The angle: that at the start and the rotation since.
    WideCounts angle(std::size_t lane) const { return origin_[lane] + turned_[lane]; }

   private:
    simd::LaneCounts last_, origin_;
    std::array<WideCounts, simd::lanes> turned_{};
};

/// An angle in arcsec.
inline double angle_arcsec(WideCounts counts, double scale_factor_arcsec) {
    const double arcsec_per_count = scale_factor_arcsec / ensemble::counts_per_fringe;
    return static_cast<double>(counts) * arcsec_per_count;
}

/// Mean output rate over a record less the input rate [deg/h].
///
/// \param turned  over the whole record
inline double rate_error_deg_h(WideCounts turned, const ensemble::Schedule& schedule, const gyro::Setup& setup) {
    const double duration_s = schedule.output_s * static_cast<double>(schedule.outputs() - 1);
    return angle_arcsec(turned, setup.scale_factor_arcsec) / duration_s - setup.input_rate_deg_h;
}

}  // namespace ringlock::study
