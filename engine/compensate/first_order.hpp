#pragma once
#include "engine/compensate/lane_compensator.hpp"

namespace ringlock::compensate {

/// The stationary-phase correction (Gao & Deng 2007): half of the kick of a turn, with a = psi'' on that side,
///
///     before or after a minimum:  f b sqrt(pi/a) (sin psi_0 + cos psi_0)
///     before or after a maximum:  f b sqrt(pi/a) (sin psi_0 - cos psi_0).
///
/// f = 1/2 is right; the paper prints f = 1 (its equations 16 and 17), which contradicts its own (7).
///
/// The acceleration that two pulses give is itself bent by the lock-in, in step with psi_0. It is therefore averaged
/// over turns, for each side of minima and of maxima by itself: all of the turns seen at first, then about the last
/// 512.
class FirstOrder final : public LaneCompensator {
   public:
    static constexpr double corrected = 0.5;
    static constexpr double published = 1.0;

    FirstOrder(const Calibration& calibration, double factor);

    void observe(const readout::LaneReadings& readings, LaneErrors& errors) override;

    struct State {
        simd::Lanes scale_fringes;  ///< f b sqrt(pi)
        /// [before a minimum, after it, before a maximum, after it]
        simd::Lanes mean_rad_s2[4];
        simd::Lanes count[4];
        simd::Lanes after_last_fringes;
        simd::Lanes error_fringes;
        simd::Lanes error_whole;
    };

   private:
    std::size_t lanes_;
    State state_;
};

}  // namespace ringlock::compensate
