#pragma once
#include <array>
#include <cstddef>

/// The equation of motion through every fringe, several gyros at a time. Shares nothing with the engine: another
/// method, another variable, a sine of its own.
///
///     psi' = g(t) + b (1 + d c(t)) F(psi),      F = sin(psi + e) + r2 sin(2 psi + f2) + r3 sin(3 psi + f3),
///
/// c(t) the cosine of the dither's phase, 1 at minima and -1 at maxima. Along the half cycle that follows a turn of
/// direction s (+1 a minimum, -1 a maximum), u the time since the turn and w = pi/duration,
///
///     g = R + A w (s sin(w u) + h sin(2 w u + f) + s k sin(3 w u)) + L sin(v u + l).
///
/// The same expression holds before the turn, u < 0, with A, w, R and b of the half cycle that ends there; l is the
/// line's phase at the turn.
///
/// Method: the plain phase P(u), the integral of g, is elementary; delta = psi - psi(turn) - P obeys delta' = b F and
/// is integrated by Gauss-Legendre collocation with five nodes (order 10), the implicit equations solved by fixed-point
/// iteration, which contracts by b times the step. Steps are 1/(sqrt(a)/c + |g|/p): p [rad] bounds the phase advance of
/// a step in fast phase, c the step near the turn in units of 1/sqrt(psi''). Errors of steps in fast phase alternate
/// and do not add up.
namespace ringlock::test::closure {

inline constexpr std::size_t lanes = 8;
using Lanes = std::array<double, lanes>;

/// Steps of the integration.
struct Accuracy {
    double phase_step_rad = 2.0;  ///< p: less where the coupling has harmonics
    double turn_step = 0.6;       ///< c
};

/// What stays the same for a gyro.
struct alignas(64) LaneDevice {
    Lanes coupling_phase_rad{};
    Lanes second_ratio{}, second_phase_rad{};
    Lanes third_ratio{}, third_phase_rad{};
    Lanes turn_asymmetry{};
    Lanes dither_ratio{}, dither_phase_rad{};  ///< second harmonic of the dither rate
    Lanes dither_third_ratio{};                ///< k: the third
    Lanes line_rad_s{}, line_w_rad_s{};        ///< L and v
    bool extras = false;                       ///< whether any of these but the coupling phase is in use
};

/// Half cycles of eight gyros.
struct alignas(64) LaneHalf {
    Lanes amplitude_rad{};
    Lanes duration_s{};
    Lanes rate_rad_s{};
    Lanes b_rad_s{};
    Lanes line_phase_rad{};  ///< at the turn that is looked at
};

/// What happens around a turn of the dither; times and phases count from there.
struct alignas(64) LaneExtremum {
    Lanes time_s{};                                 ///< where the phase rate vanishes
    Lanes phase_rad{};                              ///< gained by then since the dither's turn
    std::array<std::array<Lanes, 2>, 2> pulse_s{};  ///< [before, after][nearest, next]: quarter fringes passed
    std::array<Lanes, 2> pulse_distance_rad{};      ///< of these quarter fringes from the extremum
};

/// delta at the end of half cycles that begin at turns of direction `s` with phases `phase_rad`.
void integrate_half(const LaneDevice& device, const LaneHalf& half, double s, const Lanes& phase_rad,
                    const Accuracy& accuracy, Lanes& delta_rad);

/// Finds the zero-rate point and the pulses near a turn of direction `s` with phases `phase_rad`, by Newton's method on
/// the solution through the turn. Throws RunError where the phase rate does not change its sign near the turn.
void find_extremum(const LaneDevice& device, const LaneHalf& before, const LaneHalf& after, double s,
                   const Lanes& phase_rad, const Accuracy& accuracy, LaneExtremum& extremum);

}  // namespace ringlock::test::closure
