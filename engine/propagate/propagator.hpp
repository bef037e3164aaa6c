#pragma once
#include "engine/gyro/half_cycle.hpp"

namespace ringlock::propagate {

/// Solves the equation of motion over one half cycle of the dither. Thread-compatible: one object per gyro.
class Propagator {
   public:
    virtual ~Propagator() = default;

    /// Phase [rad] that the lock-in adds between the two turns of `half`, beyond the phase of drive and input:
    /// psi(T) - psi(0) - half.plain_phase_total_rad() - mid_step_rad.
    ///
    /// `phase_rad` is psi at the first turn (any branch; best within +-pi). `mid_step_rad` is a phase step in the
    /// middle of the half cycle, where the phase runs fastest: rates that vary slowly or at random enter as such steps.
    /// Throws RunError when the half cycle cannot be solved to the tolerance asked for.
    virtual double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half, double mid_step_rad) = 0;
};

}  // namespace ringlock::propagate
