#pragma once
#include <cstdint>

#include "engine/propagate/propagator.hpp"

namespace ringlock::propagate {

/// The reference: integrates through every fringe by Taylor series of order 20 with the step chosen so that the last
/// two terms stay below the tolerance (Jorba & Zou 2005). Nothing about the dither is assumed but its equation.
class DirectIntegrator final : public Propagator {
   public:
    /// `tolerance_rad`: error over a half cycle, shared out among its steps (two or three a fringe).
    DirectIntegrator(gyro::Coupling coupling, double tolerance_rad);

    double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) override;

    /// Steps taken so far.
    std::int64_t steps() const { return steps_; }

   private:
    gyro::Coupling coupling_;
    double tolerance_rad_;
    std::int64_t steps_ = 0;
};

}  // namespace ringlock::propagate
