#pragma once
#include <boost/multiprecision/cpp_bin_float.hpp>

#include "engine/gyro/half_cycle.hpp"

namespace ringlock::test {

/// 113 bits, eps = 1.9e-34. Boost's own arithmetic, which needs no library and no extension of the language.
using Quad = boost::multiprecision::number<boost::multiprecision::cpp_bin_float_quad::backend_type,
                                           boost::multiprecision::et_off>;

/// The equation of motion over one half cycle, solved to 1e-25 rad and better.
///
/// With w = exp(i psi) = x/y the equation is linear, x' = (i g/2) x - (b/2) y, y' = -(b/2) x - (i g/2) y
/// (docs/dev/turn-map.md), g and b as HalfCycle and Coupling say. That system goes by Taylor series of order 40 through
/// every fringe from turn to turn, without symmetry, asymptotics or interpolation, and without the sine of the phase
/// that DirectIntegrator expands. Numbers of `half` and `coupling` are taken as they are; pi, times and phases have all
/// 113 bits. One such solution holds for every phase. The delay of a half cycle must be less than half a fringe:
/// thresholds below some 5000 deg/h.
class ExtendedHalfCycle {
   public:
    /// `stride_rad`: phase that a step may run through; 5 leaves less than 1e-31 out of a step.
    /// Throws std::invalid_argument for a second harmonic of the coupling, with which nothing is linear.
    ExtendedHalfCycle(gyro::Coupling coupling, const gyro::HalfCycle& half, double stride_rad = 5.0);

    /// What Propagator::lockin_gain_rad computes in double precision [rad].
    Quad lockin_gain_rad(double phase_rad) const;

    /// How far |alpha|^2 - |beta|^2 has gone from 1: a flow in SU(1,1) keeps it, an integrator does so only by being
    /// right.
    Quad group_error() const { return group_error_; }

   private:
    gyro::Coupling coupling_;
    // psi -> psi + shift + 2 arg(1 + z exp(-i psi)), plain phase not counted
    Quad shift_rad_;
    Quad z_re_;
    Quad z_im_;
    Quad group_error_;
};

}  // namespace ringlock::test
