#pragma once
#include <cstdint>

#include "tests/support/propagator.hpp"

namespace ringlock::test {

/// The reference for one half cycle of one gyro at a time: propagate::integrate() of direct_lanes.hpp in one lane.
/// Nothing about the dither is assumed but its equation.
class DirectIntegrator final : public Propagator {
   public:
    /// `tolerance_rad`: error over a half cycle, shared out among its steps (about one a fringe).
    DirectIntegrator(gyro::Coupling coupling, double tolerance_rad)
        : coupling_(coupling), tolerance_rad_(tolerance_rad) {}

    double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) override;

    /// Steps taken so far.
    std::int64_t steps() const { return steps_; }

   private:
    gyro::Coupling coupling_;
    double tolerance_rad_;
    std::int64_t steps_ = 0;
};

}  // namespace ringlock::test
