#pragma once
#include "engine/gyro/half_cycle.hpp"

namespace ringlock::test {

/// Solves the equation of motion over one half cycle of the dither. Thread-compatible: one object per gyro.
class Propagator {
   public:
    virtual ~Propagator() = default;

    /// Phase [rad] that the lock-in adds between the two turns of `half`, beyond the phase of drive and input:
    /// psi(T) - psi(0) - half.plain_phase_total_rad().
    ///
    /// `phase_rad` is psi at the first turn (any branch; best within +-pi). Throws RunError when the half cycle cannot
    /// be solved to the tolerance asked for.
    virtual double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) = 0;
};

}  // namespace ringlock::test
