#pragma once
#include <cstdint>
#include <memory>

#include "tests/support/propagator.hpp"

namespace ringlock::test {

/// CVODE of SUNDIALS (Hindmarsh et al., ACM Transactions on Mathematical Software 31, 2005) as it is meant to be used
/// on this equation: nothing is stiff, so Adams formulas of up to order 12 with functional iteration, no linear solver.
/// Integrates the deviation from the plain phase (deviation.hpp).
class Cvode final : public Propagator {
   public:
    /// `tolerance_rad` is the absolute tolerance of CVODE's local error test, in effect for one step.
    /// `relative_tolerance` goes with the size of x, a fraction of a radian. No step is longer than
    /// `longest_step_fringes` of the half cycle's shortest fringe: a step of whole fringes would meet the same phase
    /// again and look exact.
    Cvode(gyro::Coupling coupling, double tolerance_rad, double relative_tolerance,
          double longest_step_fringes = 1.0 / 3.0);
    ~Cvode() override;
    Cvode(const Cvode&) = delete;
    Cvode& operator=(const Cvode&) = delete;

    /// Throws RunError with CVODE's own words where CVODE gives up.
    double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) override;

    /// Evaluations of the right-hand side so far.
    std::int64_t evaluations() const;

   private:
    struct Solver;
    std::unique_ptr<Solver> solver_;
};

}  // namespace ringlock::test
