#pragma once
#include <complex>
#include <span>

#include "engine/gyro/half_cycle.hpp"

namespace ringlock::propagate {

/// The exact map of the first half of a half cycle, from the turn to the middle, in the frame in which fast motion is
/// plain rotation:
///
///     phi_middle = psi_turn + (plain phase to the middle) + shift + 2 arg(1 + z exp(-i psi_turn)).
///
/// `psi` includes the coupling phase; the half cycle has sign +1. Derived in docs/dev/turn-map.md.
struct HalfTurn {
    double shift_rad = 0.0;
    std::complex<double> z;
};

/// A half turn to be solved.
struct HalfTurnProblem {
    gyro::HalfCycle half;         ///< sign +1
    double b_rad_s = 0.0;         ///< coupling at the middle
    double turn_asymmetry = 0.0;  ///< the coupling is b (1 + turn_asymmetry cos(w t))
};

/// The first half of a half cycle, turned upright: psi -> -psi maps the equation onto itself with g -> -g.
HalfTurnProblem beginning(const gyro::HalfCycle& half, const gyro::Coupling& coupling);

/// The second half of a half cycle, turned upright and reversed in time: psi(t) -> pi - psi(T - t).
HalfTurnProblem ending(const gyro::HalfCycle& half, const gyro::Coupling& coupling);

/// Computes the maps from the equation of motion, to rounding, several at once. Each result depends on its own problem
/// alone. `turns` has as many elements as `problems`.
///
/// Throws RunError where a half cycle has too few fringes for fast motion to exist between the turns.
void exact_half_turns(std::span<const HalfTurnProblem> problems, std::span<HalfTurn> turns);

/// One of them. `half.sign` must be +1.
HalfTurn exact_half_turn(const gyro::HalfCycle& half, double b_rad_s);

}  // namespace ringlock::propagate
