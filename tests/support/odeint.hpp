#pragma once
#include <cstdint>

#include "tests/support/propagator.hpp"

namespace ringlock::test {

/// Boost.odeint's Fehlberg 7(8) with its own step control, on the deviation from the plain phase (deviation.hpp).
class Odeint final : public Propagator {
   public:
    /// `tolerance_rad`: of the local error of one step. `longest_step_fringes`: no step is longer than this share of
    /// the half cycle's shortest fringe; 0: the step control is left alone.
    Odeint(gyro::Coupling coupling, double tolerance_rad, double longest_step_fringes = 0.0);

    /// Throws RunError where odeint finds no step short enough.
    double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) override;

    /// Evaluations of the right-hand side so far.
    std::int64_t evaluations() const { return evaluations_; }

   private:
    gyro::Coupling coupling_;
    double tolerance_rad_;
    double longest_step_fringes_;
    std::int64_t evaluations_ = 0;
};

}  // namespace ringlock::test
