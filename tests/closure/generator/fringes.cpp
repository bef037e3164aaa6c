#include "tests/closure/generator/fringes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "engine/core/error.hpp"

// Everything below is inlined into one function for each instruction set, at the end. No contraction to fused
// operations (the build's -ffp-contract=off): all of them give the same bits.
#define RINGLOCK_INLINE static inline __attribute__((always_inline))

namespace ringlock::test::closure {
namespace {

using V = double __attribute__((vector_size(8 * lanes)));
using M = std::int64_t __attribute__((vector_size(8 * lanes)));

constexpr std::size_t nodes = 5;
constexpr double pi = 3.14159265358979323846;

RINGLOCK_INLINE V load(const Lanes& from) {
    V v;
    std::memcpy(&v, from.data(), sizeof v);
    return v;
}
RINGLOCK_INLINE void store(const V& v, Lanes& to) { std::memcpy(to.data(), &v, sizeof v); }
RINGLOCK_INLINE V all(double x) { return V{x, x, x, x, x, x, x, x}; }
RINGLOCK_INLINE V magnitude(const V& x) { return x < 0.0 ? -x : x; }
RINGLOCK_INLINE V smaller(const V& x, const V& y) { return x < y ? x : y; }
RINGLOCK_INLINE bool any(const M& m) {
    std::int64_t bits = 0;
    for (std::size_t i = 0; i < lanes; ++i) bits |= m[i];
    return bits != 0;
}
RINGLOCK_INLINE double largest(const V& x) {
    double most = x[0];
    for (std::size_t i = 1; i < lanes; ++i) most = x[i] > most ? x[i] : most;
    return most;
}

/// x less the nearest multiple of pi, and the sign that sine and cosine take from that multiple. |x| < 1e6.
RINGLOCK_INLINE V reduced(const V& x, M& sign) {
    constexpr double magic = 6755399441055744.0;  // 3 * 2^51: its last bit is a one
    const V shifted = x * (1.0 / pi) + magic;
    const V n = shifted - magic;
    std::memcpy(&sign, &shifted, sizeof sign);
    sign = sign << 63;
    // pi in two parts, the first of 33 bits (fdlibm, e_rem_pio2.c)
    return (x - n * 3.14159265346825122834e+00) - n * 1.21542010130123844986e-10;
}
RINGLOCK_INLINE V with_sign(const V& x, const M& sign) {
    M bits;
    std::memcpy(&bits, &x, sizeof bits);
    bits ^= sign;
    V result;
    std::memcpy(&result, &bits, sizeof result);
    return result;
}
/// Taylor's series; what follows the last term is below 3e-16 for |r| <= pi/2.
RINGLOCK_INLINE V sine_of_reduced(const V& r) {
    const V x = r * r;
    V p = all(-1.0 / 121645100408832000.0);  // 19!
    p = p * x + 1.0 / 355687428096000.0;
    p = p * x - 1.0 / 1307674368000.0;
    p = p * x + 1.0 / 6227020800.0;
    p = p * x - 1.0 / 39916800.0;
    p = p * x + 1.0 / 362880.0;
    p = p * x - 1.0 / 5040.0;
    p = p * x + 1.0 / 120.0;
    p = p * x - 1.0 / 6.0;
    return r + r * x * p;
}
RINGLOCK_INLINE V cosine_of_reduced(const V& r) {
    const V x = r * r;
    V p = all(1.0 / 2432902008176640000.0);  // 20!
    p = p * x - 1.0 / 6402373705728000.0;
    p = p * x + 1.0 / 20922789888000.0;
    p = p * x - 1.0 / 87178291200.0;
    p = p * x + 1.0 / 479001600.0;
    p = p * x - 1.0 / 3628800.0;
    p = p * x + 1.0 / 40320.0;
    p = p * x - 1.0 / 720.0;
    p = p * x + 1.0 / 24.0;
    return 1.0 - x * 0.5 + x * x * p;
}
RINGLOCK_INLINE V sine(const V& x) {
    M sign;
    const V r = reduced(x, sign);
    return with_sign(sine_of_reduced(r), sign);
}
RINGLOCK_INLINE void sine_cosine(const V& x, V& s, V& c) {
    M sign;
    const V r = reduced(x, sign);
    s = with_sign(sine_of_reduced(r), sign);
    c = with_sign(cosine_of_reduced(r), sign);
}

/// Gauss-Legendre collocation: nodes c, weights b and the integrals a_ij of the Lagrange polynomials up to the nodes.
struct Collocation {
    double c[nodes];
    double b[nodes];
    double a[nodes][nodes];

    Collocation() {
        long double root[nodes];
        for (std::size_t i = 0; i < nodes; ++i) {
            long double x =
                -std::cos(static_cast<long double>(pi) * (static_cast<long double>(i) + 0.75L) / (nodes + 0.5L));
            for (int step = 0; step < 20; ++step) {
                long double before = 1.0L;
                long double p = x;  // Legendre polynomial by its recurrence
                for (std::size_t n = 2; n <= nodes; ++n) {
                    const auto m = static_cast<long double>(n);
                    const long double next = ((2.0L * m - 1.0L) * x * p - (m - 1.0L) * before) / m;
                    before = p;
                    p = next;
                }
                const long double slope = static_cast<long double>(nodes) * (x * p - before) / (x * x - 1.0L);
                x -= p / slope;
            }
            root[i] = (1.0L + x) / 2.0L;
        }
        for (std::size_t j = 0; j < nodes; ++j) {
            long double polynomial[nodes] = {1.0L};  // of Lagrange, in powers of the time
            std::size_t degree = 0;
            for (std::size_t i = 0; i < nodes; ++i) {
                if (i == j) continue;
                const long double scale = 1.0L / (root[j] - root[i]);
                for (std::size_t k = ++degree; k > 0; --k) {
                    polynomial[k] = (polynomial[k - 1] - root[i] * polynomial[k]) * scale;
                }
                polynomial[0] *= -root[i] * scale;
            }
            for (std::size_t i = 0; i <= nodes; ++i) {
                const long double x = i < nodes ? root[i] : 1.0L;
                long double sum = 0.0L;
                for (std::size_t k = nodes; k-- > 0;) sum = sum * x + polynomial[k] / static_cast<long double>(k + 1);
                (i < nodes ? a[i][j] : b[j]) = static_cast<double>(sum * x);
            }
            c[j] = static_cast<double>(root[j]);
        }
    }
};
const Collocation collocation;

/// How often the right side is evaluated: k times leaves (b h)^(k+1)/(k+1)! of the solution over a step h.
constexpr std::size_t most_evaluations = 16;
constexpr double fixed_point_tolerance = 1e-12;
struct Evaluations {
    double limit[most_evaluations + 1];  ///< b h up to which k are enough
    Evaluations() {
        double factorial = 1.0;
        for (std::size_t k = 0; k <= most_evaluations; ++k) {
            factorial *= static_cast<double>(k + 1);
            limit[k] = std::pow(fixed_point_tolerance * factorial, 1.0 / static_cast<double>(k + 1));
        }
    }
};
const Evaluations evaluations;

struct Device {
    V coupling_phase, coupling_sine, coupling_cosine;
    V second_sine, second_cosine, third_sine, third_cosine;  // ratios included
    V turn_asymmetry;
    V dither_ratio, dither_sine, dither_cosine, dither_third;
    V line, line_w;  // of the phase rate
    V stiffness;     // bound of |F'|
    V phase_step;
};
RINGLOCK_INLINE Device device_of(const LaneDevice& from, const Accuracy& accuracy) {
    Device d;
    d.coupling_phase = load(from.coupling_phase_rad);
    sine_cosine(d.coupling_phase, d.coupling_sine, d.coupling_cosine);
    const V second = load(from.second_ratio);
    const V third = load(from.third_ratio);
    sine_cosine(load(from.second_phase_rad), d.second_sine, d.second_cosine);
    d.second_sine *= second;
    d.second_cosine *= second;
    sine_cosine(load(from.third_phase_rad), d.third_sine, d.third_cosine);
    d.third_sine *= third;
    d.third_cosine *= third;
    d.turn_asymmetry = load(from.turn_asymmetry);
    d.dither_ratio = load(from.dither_ratio);
    d.dither_third = load(from.dither_third_ratio);
    sine_cosine(load(from.dither_phase_rad), d.dither_sine, d.dither_cosine);
    d.line = load(from.line_rad_s);
    d.line_w = load(from.line_w_rad_s);
    d.line_w = d.line_w > 0.0 ? d.line_w : all(1.0);
    d.stiffness = (1.0 + 2.0 * magnitude(second) + 3.0 * magnitude(third)) * (1.0 + magnitude(d.turn_asymmetry));
    // The n-th harmonic of ratio r has errors r n^10 times those of the first.
    for (std::size_t i = 0; i < lanes; ++i) {
        const double finer =
            std::max({1.0, 2.0 * std::pow(std::abs(second[i]), 0.1), 3.0 * std::pow(std::abs(third[i]), 0.1)});
        d.phase_step[i] = accuracy.phase_step_rad / finer;
    }
    return d;
}

struct Side {
    V amplitude, w, rate, b;
    V line_phase;
};
RINGLOCK_INLINE Side side_of(const LaneHalf& half) {
    return {load(half.amplitude_rad), pi / load(half.duration_s), load(half.rate_rad_s), load(half.b_rad_s),
            load(half.line_phase_rad)};
}
RINGLOCK_INLINE Side choose(const M& first, const Side& x, const Side& y) {
    return {first ? x.amplitude : y.amplitude, first ? x.w : y.w, first ? x.rate : y.rate, first ? x.b : y.b,
            x.line_phase};
}

/// Drive at a time from the turn: sine and cosine of w u, of 2 w u + f, of 3 w u and of v u + l, the plain phase
/// gained, and g.
struct Place {
    V s, c, s2, c2, s3, c3, line_s, line_c;
    V phase, rate;
};
template <bool extras>
RINGLOCK_INLINE Place place_at(const Device& d, const Side& side, double direction, const V& u) {
    Place at;
    sine_cosine(side.w * u, at.s, at.c);
    at.phase = side.rate * u + side.amplitude * direction * (1.0 - at.c);
    at.rate = side.rate + side.amplitude * side.w * direction * at.s;
    if constexpr (extras) {
        const V sine2 = 2.0 * at.s * at.c;
        const V cosine2 = 1.0 - 2.0 * at.s * at.s;
        at.s2 = sine2 * d.dither_cosine + cosine2 * d.dither_sine;
        at.c2 = cosine2 * d.dither_cosine - sine2 * d.dither_sine;
        at.phase += 0.5 * side.amplitude * d.dither_ratio * (d.dither_cosine - at.c2);
        at.rate += side.amplitude * side.w * d.dither_ratio * at.s2;
        at.s3 = at.s * (3.0 - 4.0 * at.s * at.s);
        at.c3 = at.c * (1.0 - 4.0 * at.s * at.s);
        at.phase += side.amplitude * direction * d.dither_third * (1.0 - at.c3) / 3.0;
        at.rate += side.amplitude * side.w * direction * d.dither_third * at.s3;
        V start_s, start_c;
        sine_cosine(side.line_phase, start_s, start_c);
        sine_cosine(d.line_w * u + side.line_phase, at.line_s, at.line_c);
        at.phase += d.line / d.line_w * (start_c - at.line_c);
        at.rate += d.line * at.line_s;
    }
    return at;
}

/// F(psi); without extras `x` is psi + e, with them psi.
template <bool extras>
RINGLOCK_INLINE V coupling(const Device& d, const V& x) {
    if constexpr (!extras) {
        return sine(x);
    } else {
        V s, c;
        sine_cosine(x, s, c);
        const V ss = s * s;
        return s * d.coupling_cosine + c * d.coupling_sine + 2.0 * s * c * d.second_cosine +
               (1.0 - 2.0 * ss) * d.second_sine + s * (3.0 - 4.0 * ss) * d.third_cosine +
               c * (1.0 - 4.0 * ss) * d.third_sine;
    }
}
template <bool extras>
RINGLOCK_INLINE V coupling_rate(const Device& d, const Side& side, double direction, const Place& at, const V& psi) {
    if constexpr (!extras) {
        return side.b * coupling<extras>(d, psi + d.coupling_phase);
    } else {
        return side.b * (1.0 + d.turn_asymmetry * direction * at.c) * coupling<extras>(d, psi);
    }
}

/// Sine and 1 - cosine of the little that a step turns.
RINGLOCK_INLINE void of_small(const V& z, V& sine, V& versine) {
    const V zz = z * z;
    sine = z * (1.0 - zz * (1.0 / 6.0) * (1.0 - zz * (1.0 / 20.0) * (1.0 - zz * (1.0 / 42.0))));
    versine = 0.5 * zz * (1.0 - zz * (1.0 / 12.0) * (1.0 - zz * (1.0 / 30.0) * (1.0 - zz * (1.0 / 56.0))));
}

/// delta after a step h from a place where the phase is psi.
template <bool extras>
RINGLOCK_INLINE V step_gain(const Device& d, const Side& side, double direction, const Place& at, const V& psi,
                            const V& h) {
    V base = psi;
    if constexpr (!extras) base += d.coupling_phase;
    V phase[nodes], b[nodes], gained[nodes];
    for (std::size_t i = 0; i < nodes; ++i) {
        const V t = collocation.c[i] * h;
        V sz, vz;
        of_small(side.w * t, sz, vz);
        phase[i] = base + side.rate * t + side.amplitude * direction * (at.c * vz + at.s * sz);
        b[i] = side.b * h;
        if constexpr (extras) {
            phase[i] += side.amplitude * d.dither_ratio * (at.c2 * sz * sz + at.s2 * sz * (1.0 - vz));
            V sz3, vz3;
            of_small(3.0 * side.w * t, sz3, vz3);
            phase[i] += side.amplitude * direction * d.dither_third * (at.c3 * vz3 + at.s3 * sz3) / 3.0;
            V line_sz, line_vz;
            of_small(d.line_w * t, line_sz, line_vz);
            phase[i] += d.line / d.line_w * (at.line_c * line_vz + at.line_s * line_sz);
            b[i] *= 1.0 + d.turn_asymmetry * direction * (at.c * (1.0 - vz) - at.s * sz);
        }
        gained[i] = all(0.0);
    }
    const V stiffness = magnitude(side.b * h) * d.stiffness;
    M wanted = M{1, 1, 1, 1, 1, 1, 1, 1};
    std::int64_t most = 1;
    for (std::size_t k = 1; k < most_evaluations; ++k) {
        const M more = stiffness > evaluations.limit[k];
        if (!any(more)) break;
        wanted -= more;
        ++most;
    }
    V f[nodes];
    V gain = all(0.0);
    for (std::int64_t k = 0; k < most; ++k) {
        // A gyro that needs fewer is left alone: its bits do not depend on its neighbours.
        const M active = wanted > k;
        for (std::size_t i = 0; i < nodes; ++i) f[i] = b[i] * coupling<extras>(d, phase[i] + gained[i]);
        V sum = all(0.0);
        for (std::size_t j = 0; j < nodes; ++j) sum += collocation.b[j] * f[j];
        gain = active ? sum : gain;
        if (k + 1 == most) break;
        for (std::size_t i = 0; i < nodes; ++i) {
            V to_node = all(0.0);
            for (std::size_t j = 0; j < nodes; ++j) to_node += collocation.a[i][j] * f[j];
            gained[i] = to_node;
        }
    }
    return gain;
}

RINGLOCK_INLINE V root_of(const V& x) {
    V r;
    for (std::size_t i = 0; i < lanes; ++i) r[i] = std::sqrt(x[i]);
    return r;
}

template <bool extras>
RINGLOCK_INLINE void integrate(const LaneDevice& device, const LaneHalf& half, double s, const Lanes& phase_rad,
                               const Accuracy& accuracy, Lanes& delta_rad) {
    const Device d = device_of(device, accuracy);
    const Side side = side_of(half);
    const V duration = load(half.duration_s);
    const V start = load(phase_rad);
    if (!any(side.b != 0.0)) {
        store(all(0.0), delta_rad);
        return;
    }
    const V near = side.w *
                   root_of(side.amplitude * (1.0 + 2.0 * magnitude(d.dither_ratio) + 3.0 * magnitude(d.dither_third))) /
                   accuracy.turn_step;
    const V far = 1.0 / d.phase_step;
    V u = all(0.0);
    V delta = all(0.0);
    while (any(u < duration)) {
        const Place at = place_at<extras>(d, side, s, u);
        const V h = 1.0 / (near + magnitude(at.rate) * far);
        const V left = duration - u;
        const M last = h >= left;
        const V step = last ? left : h;
        delta += step_gain<extras>(d, side, s, at, start + at.phase + delta, step);
        u = last ? duration : u + step;
    }
    store(delta, delta_rad);
}

/// The solution through the turn at a time u from it, before or after: phase gained since and phase rate.
template <bool extras>
RINGLOCK_INLINE void solution_at(const Device& d, const Side& before, const Side& after, double s, const V& start,
                                 const Accuracy& accuracy, const V& u, V& gain, V& rate) {
    const Side side = choose(u > 0.0, after, before);
    const V distance = magnitude(u);
    const V a = side.amplitude * side.w * side.w;
    const V advance = (magnitude(side.rate) + magnitude(d.line) + 0.5 * a * distance) * distance;
    const V pieces_near = distance * root_of(a) / accuracy.turn_step;
    const V pieces_far = advance / (0.6 * d.phase_step);
    const V wanted = pieces_near > pieces_far ? pieces_near : pieces_far;
    V pieces;
    for (std::size_t i = 0; i < lanes; ++i) pieces[i] = std::max(1.0, std::ceil(wanted[i]));
    const V length = u / pieces;
    V delta = all(0.0);
    V t = all(0.0);
    const double most = largest(pieces);
    for (double piece = 0.0; piece < most; piece += 1.0) {
        const V h = piece < pieces ? length : all(0.0);
        const Place at = place_at<extras>(d, side, s, t);
        delta += step_gain<extras>(d, side, s, at, start + at.phase + delta, h);
        t += h;
    }
    const Place at = place_at<extras>(d, side, s, u);
    gain = at.phase + delta;
    rate = at.rate + coupling_rate<extras>(d, side, s, at, start + gain);
}

constexpr int most_newton_steps = 400;     // at 0.8/sqrt(psi'') each: as far as a half cycle goes
constexpr double newton_tolerance = 1e-9;  // of the last correction, in 1/sqrt(psi''); it converges quadratically

template <bool extras>
RINGLOCK_INLINE bool find(const LaneDevice& device, const LaneHalf& half_before, const LaneHalf& half_after, double s,
                          const Lanes& phase_rad, const Accuracy& accuracy, LaneExtremum& extremum) {
    const Device d = device_of(device, accuracy);
    const Side before = side_of(half_before);
    const Side after = side_of(half_after);
    const V start = load(phase_rad);
    const V harmonic = 1.0 + 2.0 * s * d.dither_ratio * d.dither_cosine + 3.0 * d.dither_third;
    const V slope_before = before.amplitude * before.w * before.w * harmonic;
    const V slope_after = after.amplitude * after.w * after.w * harmonic;

    // The extremum lies after the turn where the upright phase still falls there.
    const Place at_turn = place_at<extras>(d, after, s, all(0.0));
    const M ahead = s * (at_turn.rate + coupling_rate<extras>(d, after, s, at_turn, start)) < 0.0;
    const Side side = choose(ahead, after, before);
    const V scale = 1.0 / root_of(ahead ? slope_after : slope_before);
    const V most = accuracy.turn_step * scale;
    V u = all(0.0);
    V gain, rate;
    M open = M{-1, -1, -1, -1, -1, -1, -1, -1};
    for (int step = 0; any(open); ++step) {
        if (step == most_newton_steps) return false;
        // At the turn itself the side is the one that was chosen.
        const V tiny = ahead ? all(1e-300) : all(-1e-300);
        solution_at<extras>(d, before, after, s, start, accuracy, u == 0.0 ? tiny : u, gain, rate);
        const Place at = place_at<extras>(d, side, s, u);
        V slope = side.amplitude * side.w * side.w * at.c;  // of the upright rate; b F' psi' vanishes with psi'
        if constexpr (extras) {
            slope +=
                side.amplitude * side.w * side.w * (2.0 * s * d.dither_ratio * at.c2 + 3.0 * d.dither_third * at.c3) +
                s * d.line * d.line_w * at.line_c;
        }
        const V upright = s * rate;
        V change = -upright / (slope > 0.0 ? slope : all(1.0));
        change = slope > 0.0 ? change : (upright < 0.0 ? most : -most);
        change = change > most ? most : (change < -most ? -most : change);
        V next = u + change;
        next = ahead ? (next < 0.0 ? all(0.0) : next) : (next > 0.0 ? all(0.0) : next);
        const M moved = magnitude(next - u) > newton_tolerance * scale;
        u = open ? next : u;
        open &= moved;
        if (any(magnitude(u * side.w) > 0.5 * pi)) return false;
    }
    solution_at<extras>(d, before, after, s, start, accuracy, u, gain, rate);
    store(u, extremum.time_s);
    store(gain, extremum.phase_rad);

    const V quarters = s * (start + gain) * (2.0 / pi);
    V nearest;
    for (std::size_t i = 0; i < lanes; ++i) nearest[i] = (std::floor(quarters[i]) + 1.0 - quarters[i]) * (0.5 * pi);
    for (std::size_t pulse = 0; pulse < 2; ++pulse) {
        const V distance = nearest + static_cast<double>(pulse) * (0.5 * pi);
        store(distance, extremum.pulse_distance_rad[pulse]);
        for (std::size_t which = 0; which < 2; ++which) {
            const V a = which == 0 ? slope_before : slope_after;
            const V away = root_of(2.0 * distance / a);
            const double outward = which == 0 ? -1.0 : 1.0;
            V t = u + outward * away;
            open = M{-1, -1, -1, -1, -1, -1, -1, -1};
            for (int step = 0; any(open); ++step) {
                if (step == most_newton_steps) return false;
                V there, speed;
                solution_at<extras>(d, before, after, s, start, accuracy, t, there, speed);
                const V miss = s * (there - gain) - distance;
                const V slope = s * speed * outward;
                V change = -outward * miss / (slope > 0.0 ? slope : all(1.0));
                const V bound = 0.5 * away;
                change = slope > 0.0 ? change : outward * bound;
                change = change > bound ? bound : (change < -bound ? -bound : change);
                const M moved = magnitude(change) * root_of(a) > newton_tolerance;
                t = open ? t + change : t;
                open &= moved;
            }
            store(t, extremum.pulse_s[which][pulse]);
        }
    }
    return true;
}

#undef RINGLOCK_INLINE

/// Both functions for one instruction set.
#define RINGLOCK_KERNELS(NAME, ATTRIBUTES)                                                                         \
    ATTRIBUTES void integrate_##NAME(const LaneDevice& device, const LaneHalf& half, double s, const Lanes& phase, \
                                     const Accuracy& accuracy, Lanes& delta) {                                     \
        if (device.extras) {                                                                                       \
            integrate<true>(device, half, s, phase, accuracy, delta);                                              \
        } else {                                                                                                   \
            integrate<false>(device, half, s, phase, accuracy, delta);                                             \
        }                                                                                                          \
    }                                                                                                              \
    ATTRIBUTES bool find_##NAME(const LaneDevice& device, const LaneHalf& before, const LaneHalf& after, double s, \
                                const Lanes& phase, const Accuracy& accuracy, LaneExtremum& extremum) {            \
        return device.extras ? find<true>(device, before, after, s, phase, accuracy, extremum)                     \
                             : find<false>(device, before, after, s, phase, accuracy, extremum);                   \
    }

RINGLOCK_KERNELS(plain, )
#if defined(__x86_64__)
RINGLOCK_KERNELS(avx2, __attribute__((target("avx2"))))
RINGLOCK_KERNELS(avx512, __attribute__((target("avx512f,avx512dq,avx512vl"))))
#endif

struct Kernels {
    decltype(&integrate_plain) integrate = integrate_plain;
    decltype(&find_plain) find = find_plain;
    Kernels() {
#if defined(__x86_64__)
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
            __builtin_cpu_supports("avx512vl")) {
            integrate = integrate_avx512;
            find = find_avx512;
        } else if (__builtin_cpu_supports("avx2")) {
            integrate = integrate_avx2;
            find = find_avx2;
        }
#endif
    }
};

const Kernels& kernels() {
    static const Kernels chosen;
    return chosen;
}

}  // namespace

void integrate_half(const LaneDevice& device, const LaneHalf& half, double s, const Lanes& phase_rad,
                    const Accuracy& accuracy, Lanes& delta_rad) {
    kernels().integrate(device, half, s, phase_rad, accuracy, delta_rad);
}

void find_extremum(const LaneDevice& device, const LaneHalf& before, const LaneHalf& after, double s,
                   const Lanes& phase_rad, const Accuracy& accuracy, LaneExtremum& extremum) {
    if (!kernels().find(device, before, after, s, phase_rad, accuracy, extremum)) {
        throw RunError("the phase rate does not change its sign near a turn of the dither");
    }
}

}  // namespace ringlock::test::closure
