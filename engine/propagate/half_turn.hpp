#pragma once
#include <complex>

#include "engine/gyro/half_cycle.hpp"

namespace ringlock::propagate {

/// The exact map of the first half of a half cycle, from the turn to the middle, in the frame in which fast motion is
/// plain rotation:
///
///     phi_middle = psi_turn + (plain phase to the middle) + shift + 2 arg(1 + z exp(-i psi_turn)).
///
/// `psi` includes the coupling phase; the half cycle has sign +1. Derived in docs/turn-map.md.
struct HalfTurn {
    double shift_rad = 0.0;
    std::complex<double> z;
};

/// Computes the map from the equation of motion, to rounding. `half.sign` must be +1.
///
/// Throws RunError where the half cycle has too few fringes for fast motion to exist between the turns.
HalfTurn exact_half_turn(const gyro::HalfCycle& half, double b_rad_s);

/// Whether exact_half_turn can be formed: enough fringes between the turn and the middle.
bool has_fast_middle(const gyro::HalfCycle& half);

/// The slow solution K(t) of the fast flow, to which i times the Riccati equation w' = i g w + (b/2)(w^2 - 1) is
/// pinned between turns: w = -i K, K = (b/2)(1 + K^2)/g - i K'/g, as an asymptotic series in 1/(t g).
std::complex<double> slow_solution(const gyro::HalfCycle& half, double b_rad_s, double t_s);

}  // namespace ringlock::propagate
