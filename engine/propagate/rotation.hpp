#pragma once
#include <complex>
#include <cstdint>

#include "engine/gyro/device.hpp"
#include "engine/gyro/half_cycle.hpp"

/// Mean rates without simulation: a drive that repeats itself is one Moebius map of the circle a cycle, and the
/// rotation number of that map is the mean rate. Derived in docs/dev/turn-map.md, "Whole turns and cycles".
namespace ringlock::propagate {

/// A Moebius map of the unit circle, w -> (alpha w + beta)/(conj(beta) w + conj(alpha)), together with the whole
/// fringes that w = exp(i psi) does not show:
///
///     psi -> psi + plain + shift + 2 arg(1 + z exp(-i psi)),      z = beta/alpha,  |z| < 1.
///
/// The argument stays within a quarter turn, so plain + shift holds all fringes. `plain` is the phase of drive and
/// input alone, kept apart because it is known exactly and may be thousands of radians.
struct LiftedMap {
    double plain_rad = 0.0;
    double shift_rad = 0.0;
    std::complex<double> z;

    /// Entries of the matrix in SU(1,1), with the sign that continuity from the identity gives them.
    std::complex<double> alpha() const;
    std::complex<double> beta() const;
    /// Of the matrix: 2 Re alpha. Beyond +-2 the map has fixed points on the circle.
    double trace() const;

    /// Phase gained beyond `plain_rad` from `phase_rad` on [rad].
    double gain_rad(double phase_rad) const;
    /// The map has a fixed point: applied again and again it gains whole fringes, from any phase.
    bool locked() const;
    /// Whole fringes nearest to plain + shift: those that a locked map gains.
    std::int64_t fringes() const;
    /// Rotation number, the mean gain of an application, beyond `plain_rad` [rad]. Less than half a fringe from
    /// `shift_rad`. Its error is that of shift and z, but within some 1e-12 rad of a band's edge the square root of it.
    double rotation_beyond_plain_rad() const;
    /// Slope of a locked map at its attracting fixed point, in (0, 1]: distances between phases shrink by it with each
    /// application. 1 at a band's edge and where the map is not locked.
    double contraction() const;
};

/// `first`, then `second`.
LiftedMap then(const LiftedMap& first, const LiftedMap& second);

/// The map from one turn to the next, of two half turns. Throws RunError where exact_half_turn() does.
LiftedMap exact_half_cycle(const gyro::HalfCycle& half, const gyro::Coupling& coupling);

/// The map of a whole cycle of the noise-free dither, from minimum to minimum, coupling phase included; exact to
/// rounding. Throws RunError where has_exact_cycle() is false.
LiftedMap exact_cycle(const gyro::Device& device);

/// Whether exact_cycle() can be formed: enough fringes in both half cycles, a dither that reverses the input rate, and
/// a coupling without second harmonic.
bool has_exact_cycle(const gyro::Device& device);

/// Mean output rate less input rate [deg/h] of a gyro whose drive repeats itself, over infinite time. The mean over a
/// record of T s lies within a fringe over the record, K/T, of it.
double mean_rate_error_deg_h(const LiftedMap& cycle, const gyro::Device& device);

}  // namespace ringlock::propagate
