#include "engine/propagate/half_turn.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/propagate/half_turn.cpp"
#include "engine/core/error.hpp"
#include "engine/gyro/fast_motion.hpp"
#include "engine/simd/lanes.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

#ifndef RINGLOCK_HALF_TURN_BATCH
#define RINGLOCK_HALF_TURN_BATCH
namespace ringlock::propagate {
namespace {

constexpr std::size_t quadrature_nodes = 20;

/// Problems side by side, one in each lane, with the choices that are made for each beforehand.
struct Batch {
    simd::Lanes amplitude_rad, angular_frequency_rad_s, rate_rad_s, harmonic_ratio, harmonic_phase_fringes;
    simd::Lanes amplitude_change_rad;
    simd::Lanes b_rad_s, turn_asymmetry;
    simd::Lanes fast_from_s;
    simd::Lanes longest_step_s;
    simd::Lanes quadrature_time_s[quadrature_nodes];
    simd::Lanes quadrature_weight_s[quadrature_nodes];
    // Results
    simd::Lanes alpha_re, alpha_im, z_re, z_im;
    simd::Lanes slowed_rad;
    simd::Lanes turned_rad;  // argument of alpha, followed from 0 on: strong coupling turns it by whole fringes
};

}  // namespace
}  // namespace ringlock::propagate
#endif

HWY_BEFORE_NAMESPACE();
namespace ringlock::propagate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

constexpr std::size_t slow_terms = 10;    // terms of the asymptotic series, and Taylor terms that its derivatives need
constexpr std::size_t matrix_order = 24;  // Taylor order of the 2x2 flow
/// Taylor terms of the drive. A step is at most 0.9/sqrt(a) long: with an amplitude of 10 rad, the least allowed, the
/// twelfth term of the second harmonic is (0.57)^12/12! of the first.
constexpr std::size_t drive_terms = 12;

/// The drive and the coupling of a vector of problems.
template <class D, class V = hn::Vec<D>>
struct Problems {
    D d;
    V amplitude, change, w, rate, ratio, harmonic_phase, b, asymmetry;

    Problems(D tag, const Batch& batch, std::size_t lane)
        : d(tag),
          amplitude(hn::Load(d, batch.amplitude_rad.data() + lane)),
          change(hn::Load(d, batch.amplitude_change_rad.data() + lane)),
          w(hn::Load(d, batch.angular_frequency_rad_s.data() + lane)),
          rate(hn::Load(d, batch.rate_rad_s.data() + lane)),
          ratio(hn::Load(d, batch.harmonic_ratio.data() + lane)),
          harmonic_phase(hn::Load(d, batch.harmonic_phase_fringes.data() + lane)),
          b(hn::Load(d, batch.b_rad_s.data() + lane)),
          asymmetry(hn::Load(d, batch.turn_asymmetry.data() + lane)) {}

    /// Taylor coefficients of g(t + scale x) scale and b(t + scale x) scale in powers of x.
    template <std::size_t N>
    HWY_INLINE void series(V t, V scale, V (&g)[N], V (&coupling)[N]) const {
        const V fringes = w * t * hn::Set(d, 0.15915494309189535);
        V s1, c1, s2, c2;
        sm::sincos(d, fringes, s1, c1);
        sm::sincos(d, fringes + fringes + harmonic_phase, s2, c2);
        const V x = w * scale;
        const V per_pi = hn::Set(d, 0.3183098861837907);
        V first = sm::fma(d, change, sm::fma(d, w * t, per_pi, hn::Set(d, -0.5)), amplitude) * x;
        V second = amplitude * x * ratio;
        V growth =
            change * per_pi * x * x;  // of the amplitude over the unit of time, times the term before of the sine
        V last_sine = hn::Zero(d);
        V swing = b * asymmetry * scale;
        for (std::size_t n = 0; n < N; ++n) {
            const V sine = n % 4 == 0 ? s1 : n % 4 == 1 ? c1 : n % 4 == 2 ? hn::Neg(s1) : hn::Neg(c1);
            const V cosine = n % 4 == 0 ? c1 : n % 4 == 1 ? hn::Neg(s1) : n % 4 == 2 ? hn::Neg(c1) : s1;
            const V doubled = n % 4 == 0 ? s2 : n % 4 == 1 ? c2 : n % 4 == 2 ? hn::Neg(s2) : hn::Neg(c2);
            g[n] = sm::fma(d, first, sine, second * doubled);
            if (n > 0) g[n] = sm::fma(d, growth, last_sine, g[n]);
            if (n > 0) growth = growth * x * hn::Set(d, 1.0 / static_cast<double>(n));
            last_sine = sine;
            coupling[n] = swing * cosine;
            const V step = x * hn::Set(d, 1.0 / static_cast<double>(n + 1));
            first = first * step;
            second = second * (step + step);
            swing = swing * step;
        }
        g[0] = sm::fma(d, rate, scale, g[0]);
        coupling[0] = sm::fma(d, b, scale, coupling[0]);
    }
};

/// First column (x, y) of the flow of x' = (i g/2) x - (b/2) y, y' = -(b/2) x - (i g/2) y from time 0 to `end`: the
/// Moebius map w -> (x w + conj y)/(y w + conj x). `turned`: argument of x, followed from step to step.
template <class D, class V>
HWY_INLINE void flow(D d, const Problems<D>& problems, V end, V longest, sm::Complex<V>& x, sm::Complex<V>& y,
                     V& turned) {
    const V zero = hn::Zero(d);
    turned = zero;
    x = {hn::Set(d, 1.0), zero};
    y = {zero, zero};
    V t = zero;
    while (!hn::AllTrue(d, t >= end)) {
        // Terms of order 24 of exp(i (g h/2 + a h^2/4)) below 1e-17.
        V g[drive_terms];
        V b[drive_terms];
        V now_g[1];
        V now_b[1];
        problems.series(t, hn::Set(d, 1.0), now_g, now_b);
        const V rate = hn::Abs(now_g[0]) + now_b[0];
        const V next = hn::Min(t + hn::Min(hn::Set(d, 3.6) / rate, longest), end);
        const V h = next - t;
        problems.series(t, h, g, b);
        sm::Complex<V> xs[matrix_order + 1];
        sm::Complex<V> ys[matrix_order + 1];
        xs[0] = x;
        ys[0] = y;
        for (std::size_t n = 0; n < matrix_order; ++n) {
            sm::Complex<V> gx{zero, zero};
            sm::Complex<V> gy{zero, zero};
            sm::Complex<V> bx{zero, zero};
            sm::Complex<V> by{zero, zero};
            for (std::size_t j = 0; j <= n && j < drive_terms; ++j) {
                gx = {sm::fma(d, g[j], xs[n - j].re, gx.re), sm::fma(d, g[j], xs[n - j].im, gx.im)};
                gy = {sm::fma(d, g[j], ys[n - j].re, gy.re), sm::fma(d, g[j], ys[n - j].im, gy.im)};
                bx = {sm::fma(d, b[j], xs[n - j].re, bx.re), sm::fma(d, b[j], xs[n - j].im, bx.im)};
                by = {sm::fma(d, b[j], ys[n - j].re, by.re), sm::fma(d, b[j], ys[n - j].im, by.im)};
            }
            const V scale = hn::Set(d, 0.5 / static_cast<double>(n + 1));
            xs[n + 1] = {hn::Neg(scale * (gx.im + by.re)), scale * (gx.re - by.im)};
            ys[n + 1] = {scale * (gy.im - bx.re), hn::Neg(scale * (gy.re + bx.im))};
        }
        x = {zero, zero};
        y = {zero, zero};
        for (std::size_t n = matrix_order + 1; n-- > 0;) {
            x = {x.re + xs[n].re, x.im + xs[n].im};
            y = {y.re + ys[n].re, y.im + ys[n].im};
        }
        const sm::Complex<V> step = sm::mul(d, x, sm::Complex<V>{xs[0].re, hn::Neg(xs[0].im)});
        turned = turned + sm::arg(d, step.re, step.im);  // some 2 rad, for |y| < |x|
        t = next;
    }
}

/// The slow solution K(t) of the fast flow, to which the Riccati equation w' = i g w + (b/2)(w^2 - 1) is pinned between
/// turns: w = -i K, K = (b/2)(1 + K^2)/g - i K'/g, as an asymptotic series in 1/(t g).
template <class D, class V>
HWY_INLINE sm::Complex<V> slow_solution(D d, const Problems<D>& problems, V t) {
    // K is iterated as a truncated Taylor series in w (t' - t); each pass makes one more order of the asymptotic series
    // right and uses up one Taylor coefficient for the derivative.
    const V zero = hn::Zero(d);
    V g[slow_terms];
    V b[slow_terms];
    problems.series(t, hn::Set(d, 1.0) / problems.w, g, b);
    const V inverse = hn::Set(d, 1.0) / g[0];
    sm::Complex<V> k[slow_terms];
    for (auto& term : k) term = {zero, zero};
    for (std::size_t pass = 0; pass < slow_terms; ++pass) {
        // Of pass p the first slow_terms - p coefficients are of use to the next ones.
        const std::size_t terms = slow_terms - pass;
        sm::Complex<V> square[slow_terms];  // 1 + K^2
        for (std::size_t n = 0; n < terms; ++n) {
            sm::Complex<V> sum{n == 0 ? hn::Set(d, 1.0) : zero, zero};
            for (std::size_t j = 0; j <= n; ++j) sum = sm::mul_add(d, k[j], k[n - j], sum);
            square[n] = sum;
        }
        sm::Complex<V> next[slow_terms];
        for (std::size_t n = 0; n < terms; ++n) {
            sm::Complex<V> right{zero, zero};
            for (std::size_t j = 0; j <= n; ++j) {
                right = {sm::fma(d, b[j], square[n - j].re, right.re), sm::fma(d, b[j], square[n - j].im, right.im)};
            }
            right = {right.re * hn::Set(d, 0.5), right.im * hn::Set(d, 0.5)};
            if (n + 1 < slow_terms) {  // - i K'
                const V factor = hn::Set(d, static_cast<double>(n + 1));
                right = {sm::fma(d, factor, k[n + 1].im, right.re), sm::fnma(d, factor, k[n + 1].re, right.im)};
            }
            for (std::size_t j = 1; j <= n; ++j) {
                right = {sm::fnma(d, g[j], next[n - j].re, right.re), sm::fnma(d, g[j], next[n - j].im, right.im)};
            }
            next[n] = {right.re * inverse, right.im * inverse};
        }
        for (std::size_t n = 0; n < terms; ++n) k[n] = next[n];
    }
    return k[0];
}

void solve(Batch& batch, std::size_t lanes) {
    using D = hn::CappedTag<double, simd::lanes>;
    using V = hn::Vec<D>;
    const D d;
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const Problems<D> problems(d, batch, lane);
        const V start = hn::Load(d, batch.fast_from_s.data() + lane);
        sm::Complex<V> x;
        sm::Complex<V> y;
        V turned;
        flow(d, problems, start, hn::Load(d, batch.longest_step_s.data() + lane), x, y, turned);
        const sm::Complex<V> k = slow_solution(d, problems, start);
        // z = (w + i K)/(1 - i conj(K) w) after w -> (x w + conj y)/(y w + conj x); the common factor 1/sqrt(1 - |K|^2)
        // is real and drops out. alpha = x + i K y, beta = conj y + i K conj x.
        const sm::Complex<V> ik{hn::Neg(k.im), k.re};
        const sm::Complex<V> alpha = sm::mul_add(d, ik, y, x);
        const sm::Complex<V> beta =
            sm::mul_add(d, ik, sm::Complex<V>{x.re, hn::Neg(x.im)}, sm::Complex<V>{y.re, hn::Neg(y.im)});
        const V inverse = hn::Set(d, 1.0) / sm::norm(d, alpha);
        const sm::Complex<V> z = sm::mul(d, beta, sm::Complex<V>{alpha.re, hn::Neg(alpha.im)});
        // |K y| < |x|: alpha lies within a quarter turn of x.
        const sm::Complex<V> bend = sm::mul(d, alpha, sm::Complex<V>{x.re, hn::Neg(x.im)});
        hn::Store(turned + sm::arg(d, bend.re, bend.im), d, batch.turned_rad.data() + lane);
        hn::Store(alpha.re, d, batch.alpha_re.data() + lane);
        hn::Store(alpha.im, d, batch.alpha_im.data() + lane);
        hn::Store(z.re * inverse, d, batch.z_re.data() + lane);
        hn::Store(z.im * inverse, d, batch.z_im.data() + lane);
        // From `start` to the middle the frame turns at g - b Re K.
        V slowed = hn::Zero(d);
        for (std::size_t node = 0; node < quadrature_nodes; ++node) {
            const V t = hn::Load(d, batch.quadrature_time_s[node].data() + lane);
            V g[1];
            V b[1];
            problems.series(t, hn::Set(d, 1.0), g, b);
            const V weight = hn::Load(d, batch.quadrature_weight_s[node].data() + lane) * b[0];
            slowed = sm::fma(d, weight, slow_solution(d, problems, t).re, slowed);
        }
        hn::Store(slowed, d, batch.slowed_rad.data() + lane);
    }
}

}  // namespace ringlock::propagate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::propagate {

HWY_EXPORT(solve);

namespace {

/// Fills one lane. K is proportional to 1/(t - zero), and the substitution t - zero = (start - zero) stretch^u removes
/// that factor from the quadrature.
void prepare(Batch& batch, std::size_t lane, const HalfTurnProblem& problem, double start_s) {
    const gyro::HalfCycle& half = problem.half;
    const double w = half.angular_frequency_rad_s();
    batch.amplitude_rad[lane] = half.amplitude_rad;
    batch.amplitude_change_rad[lane] = half.amplitude_change_rad;
    batch.angular_frequency_rad_s[lane] = w;
    batch.rate_rad_s[lane] = half.rate_rad_s;
    batch.harmonic_ratio[lane] = half.harmonic_ratio;
    batch.harmonic_phase_fringes[lane] = half.harmonic_phase_rad / units::two_pi;
    batch.b_rad_s[lane] = problem.b_rad_s;
    batch.turn_asymmetry[lane] = problem.turn_asymmetry;
    batch.fast_from_s[lane] = start_s;
    batch.longest_step_s[lane] = std::sqrt(0.8 / gyro::greatest_acceleration_rad_s2(half));
    const double zero = gyro::zero_rate_s(half);
    const double stretch = std::log((0.5 * half.duration_s - zero) / (start_s - zero));
    using Gauss = boost::math::quadrature::gauss<double, quadrature_nodes>;
    for (std::size_t node = 0; node < quadrature_nodes; ++node) {
        const std::size_t pair = node / 2;  // Boost keeps the positive abscissas of a symmetric rule
        const double side = node % 2 == 0 ? 1.0 : -1.0;
        const double u = 0.5 + 0.5 * side * Gauss::abscissa()[pair];
        const double since = (start_s - zero) * std::exp(stretch * u);
        batch.quadrature_time_s[node][lane] = zero + since;
        batch.quadrature_weight_s[node][lane] = 0.5 * Gauss::weights()[pair] * since * stretch;
    }
}

}  // namespace

HalfTurnProblem beginning(const gyro::HalfCycle& half, const gyro::Coupling& coupling) {
    return {half.upright(0), coupling.b_rad_s, half.sign * coupling.turn_asymmetry};
}

HalfTurnProblem ending(const gyro::HalfCycle& half, const gyro::Coupling& coupling) {
    // cos(w (T - t)) = -cos(w t)
    return {half.upright(1), coupling.b_rad_s, -half.sign * coupling.turn_asymmetry};
}

void exact_half_turns(std::span<const HalfTurnProblem> problems, std::span<HalfTurn> turns) {
    Batch batch;
    for (std::size_t first = 0; first < problems.size(); first += simd::lanes) {
        const std::size_t count = std::min(simd::lanes, problems.size() - first);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const HalfTurnProblem& problem = problems[first + std::min(lane, count - 1)];
            const double start = gyro::fast_motion_from_s(problem.half, problem.b_rad_s);
            if (std::isnan(start)) {
                throw RunError(
                    fmt::format("turn map: a half cycle of {:.1f} fringes at an input of {:.4g} rad/s and a coupling "
                                "of {:.4g} rad/s has no fast middle; use propagation.method = \"direct\"",
                                problem.half.amplitude_rad / units::pi, problem.half.rate_rad_s, problem.b_rad_s));
            }
            prepare(batch, lane, problem, start);
        }
        HWY_DYNAMIC_DISPATCH(solve)(batch, count);
        for (std::size_t lane = 0; lane < count; ++lane) {
            HalfTurn& turn = turns[first + lane];
            const double plain = problems[first + lane].half.plain_phase_rad(batch.fast_from_s[lane]);
            const double angle = 2.0 * std::atan2(batch.alpha_im[lane], batch.alpha_re[lane]);
            // The fringe from the argument that was followed, the rest from alpha itself: a sum over steps loses
            // digits.
            const double rest = std::remainder(angle - plain, units::two_pi);
            const double fringes = std::nearbyint((2.0 * batch.turned_rad[lane] - plain - rest) / units::two_pi);
            turn.shift_rad = rest + units::two_pi * fringes - batch.slowed_rad[lane];
            turn.z = {batch.z_re[lane], batch.z_im[lane]};
        }
    }
}

HalfTurn exact_half_turn(const gyro::HalfCycle& half, double b_rad_s) {
    const HalfTurnProblem problem{half, b_rad_s, 0.0};
    HalfTurn turn;
    exact_half_turns({&problem, 1}, {&turn, 1});
    return turn;
}

}  // namespace ringlock::propagate
#endif
