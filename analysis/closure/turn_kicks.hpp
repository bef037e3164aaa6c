#pragma once
#include <array>
#include <complex>
#include <span>
#include <vector>

#include "engine/gyro/setup.hpp"

namespace ringlock::closure {

/// What the lock-in adds to the phase on either side of a turn, as functions of the phase at its zero-rate point:
///
///     psi_{n+1} - psi_n = (drive and input between the dither's turns) + after_n(psi_n) + before_{n+1}(psi_{n+1}).
///
/// Exact for a dither of the setup's amplitude: from the equation of motion, with all that the setup knows of coupling
/// and dither (docs/closure.md). Half turns go with one over the root of the phase's acceleration, which carries them
/// to amplitudes nearby.
class TurnKicks {
   public:
    /// Throws RunError where half cycles of the setup have too few fringes.
    explicit TurnKicks(const gyro::Setup& setup);

    struct Kick {
        double before_rad, after_rad;
        double before_slope, after_slope;  ///< derivatives to the phase
    };
    /// `direction`: +1 at a minimum, -1 at a maximum.
    Kick at(int direction, double phase_rad) const;

   private:
    static constexpr std::size_t harmonics = 12;
    using Series = std::array<std::complex<double>, harmonics + 1>;  ///< value = Re sum_k c_k exp(i k psi)
    std::array<std::array<Series, 2>, 2> series_{};                  ///< [minimum, maximum][before, after]
};

}  // namespace ringlock::closure
