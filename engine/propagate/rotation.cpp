#include "engine/propagate/rotation.hpp"

#include <array>
#include <cmath>

#include "engine/core/phase.hpp"
#include "engine/gyro/fast_motion.hpp"
#include "engine/propagate/circle_map.hpp"
#include "engine/propagate/half_turn.hpp"

namespace ringlock::propagate {

namespace {

using Complex = std::complex<double>;

/// plain + shift as whole fringes and a remainder.
Phase gained(const LiftedMap& map) {
    Phase sum(map.plain_rad);
    sum.add(map.shift_rad);
    return sum;
}

/// Quantities that decide between locked and free, for d = plain + shift less whole fringes.
struct Edge {
    double excess;  ///< sin^2(d/2) - |z|^2: negative where locked
    double cosine;  ///< cos(d/2), >= 0
};

Edge edge(const LiftedMap& map, double d_rad) {
    // tr^2/4 - 1 = -excess/(1 - |z|^2). Taken as a product, the excess keeps its digits where the trace is near 2.
    const double sine = std::abs(std::sin(0.5 * d_rad));
    const double size = std::abs(map.z);
    return {(sine - size) * (sine + size), std::cos(0.5 * d_rad)};
}
}  // namespace

Complex LiftedMap::alpha() const {
    const Phase sum = gained(*this);
    // The matrix turns by half the phase: an odd fringe changes its sign.
    const double sign = sum.fringes % 2 == 0 ? 1.0 : -1.0;
    return sign / std::sqrt(1.0 - std::norm(z)) * std::polar(1.0, 0.5 * sum.remainder_rad);
}

Complex LiftedMap::beta() const { return alpha() * z; }

double LiftedMap::trace() const { return 2.0 * alpha().real(); }

double LiftedMap::gain_rad(double phase_rad) const { return shift_rad + twice_arg(z, -phase_rad); }

bool LiftedMap::locked() const { return edge(*this, gained(*this).remainder_rad).excess <= 0.0; }

std::int64_t LiftedMap::fringes() const { return gained(*this).fringes; }

double LiftedMap::rotation_beyond_plain_rad() const {
    const double d = gained(*this).remainder_rad;
    const Edge at = edge(*this, d);
    const double turned = at.excess > 0.0 ? 2.0 * std::atan2(std::sqrt(at.excess), at.cosine) : 0.0;
    return shift_rad + (std::copysign(turned, d) - d);
}

double LiftedMap::contraction() const {
    const Edge at = edge(*this, gained(*this).remainder_rad);
    if (at.excess >= 0.0) return 1.0;
    // Eigenvalues of the matrix are (c +- q)/sqrt(1 - |z|^2), q^2 = |z|^2 - sin^2(d/2); the slope is their ratio.
    const double q = std::sqrt(-at.excess);
    return (at.cosine - q) / (at.cosine + q);
}

LiftedMap then(const LiftedMap& first, const LiftedMap& second) {
    // alpha = alpha_2 alpha_1 (1 + z_2 conj(z_1) exp(-i s_1)), s_1 the shift of the first in full. The bracket's
    // argument has no branch to choose and goes to 0 with z, as the lift must.
    const Complex turned = second.z * std::polar(1.0, -gained(first).remainder_rad);
    const Complex bracket = 1.0 + turned * std::conj(first.z);
    return {first.plain_rad + second.plain_rad, first.shift_rad + second.shift_rad + 2.0 * std::arg(bracket),
            (first.z + turned) / bracket};
}

LiftedMap exact_half_cycle(const gyro::HalfCycle& half, const gyro::Coupling& coupling) {
    const std::array problems{beginning(half, coupling), ending(half, coupling)};
    std::array<HalfTurn, 2> turns;
    exact_half_turns(problems, turns);
    // The way back from the middle, u -> u - 2 arg(1 + z exp(i u)), is the map of conj(z).
    const LiftedMap to_middle{problems[0].half.plain_phase_total_rad(), turns[0].shift_rad + turns[1].shift_rad,
                              turns[0].z};
    LiftedMap map = then(to_middle, {0.0, 0.0, std::conj(turns[1].z)});
    if (half.sign < 0.0) map = {-map.plain_rad, -map.shift_rad, std::conj(map.z)};
    map.z *= std::polar(1.0, -coupling.phase_rad);  // psi + e -> psi
    return map;
}

LiftedMap exact_cycle(const gyro::Device& device) {
    const double amplitude = device.dither_amplitude_rad;
    LiftedMap cycle = then(exact_half_cycle(device.half_cycle(1.0, amplitude), device.coupling),
                           exact_half_cycle(device.half_cycle(-1.0, amplitude), device.coupling));
    cycle.plain_rad = device.input_rate_rad_s * device.period_s();  // the swings cancel, their rounding does not
    return cycle;
}

bool has_exact_cycle(const gyro::Device& device) {
    if (device.coupling.second_ratio != 0.0) return false;
    const double amplitude = device.dither_amplitude_rad;
    const auto fast = [&](double sign) {
        const gyro::HalfCycle half = device.half_cycle(sign, amplitude);
        // A harmonic of the dither makes the rates of the two halves unequal.
        return gyro::has_fast_middle(half.upright(0), device.coupling.b_rad_s) &&
               gyro::has_fast_middle(half.upright(1), device.coupling.b_rad_s);
    };
    return fast(1.0) && fast(-1.0);
}

double mean_rate_error_deg_h(const LiftedMap& cycle, const gyro::Device& device) {
    return cycle.rotation_beyond_plain_rad() / (device.period_s() * device.phase_per_arcsec);
}

}  // namespace ringlock::propagate
