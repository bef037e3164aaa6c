// The path of the phase near a turn in vector lanes, for sources that are compiled once for each instruction set.
#if defined(RINGLOCK_TURN_SERIES) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGLOCK_TURN_SERIES
#undef RINGLOCK_TURN_SERIES
#else
#define RINGLOCK_TURN_SERIES
#endif

#include <cstdint>

#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::gyro::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

/// A half cycle next to a turn, turned upright (x = psi + coupling phase at minima, its negative at maxima):
///
///     x' = rate + A w (sin(w t) + ratio sin(2 w t + f)) + b (1 + asymmetry cos(w t)) (sin(x) + second sin(2 x + h)),
///
/// t from the dither's turn, in either direction. `scale_s` is the unit of time of the series, near 1/(w sqrt(A)), in
/// which the drive's acceleration is about one, and `angle` is w times it.
template <class V>
struct UprightSide {
    V amplitude, w, rate, b;
    V scale_s, angle;
};

/// Parameters that only some devices have; code that is compiled without them takes them as zero.
template <class V>
struct UprightExtras {
    V ratio, harmonic_sine, harmonic_cosine;  ///< of f
    V asymmetry;
    V second, second_sine, second_cosine;  ///< of h
};

/// Taylor series of x and of the lock-in's share of it, around a point of the path. Within longest_step() the
/// truncation error is below 1e-10 rad, at slow input rates below 1e-12.
///
/// Compiled without `extras` it gives, where these are zero, the same bits in half the time.
template <class D, bool extras, class V = hn::Vec<D>>
struct TurnSeries {
    static constexpr std::size_t order = 7;
    V rate[order + 1];    ///< n times the n-th coefficient of x
    V lockin[order + 1];  ///< n times that of the lock-in's share

    /// Around the time and the phase x whose sines and cosines of w t and x are given.
    HWY_INLINE void expand(D d, const UprightSide<V>& side, const UprightExtras<V>& extra, V sine_wt, V cosine_wt,
                           V sine_x, V cosine_x) {
        V drive[order];
        V first = side.amplitude * side.angle;
        RINGLOCK_UNROLL
        for (std::size_t n = 0; n < order; ++n) {
            drive[n] = first * (n % 2 == 0 ? sine_wt : cosine_wt);
            const double sign = n % 2 == 1 ? -1.0 : 1.0;  // sin, cos, -sin, -cos
            if (n + 1 < order) first = first * (side.angle * hn::Set(d, sign / static_cast<double>(n + 1)));
        }
        V doubled_sines[extras ? order : 1];  // of 2 x + h
        V doubled_cosines[extras ? order : 1];
        V couplings[3] = {side.b * side.scale_s, hn::Zero(d), hn::Zero(d)};
        if constexpr (extras) {
            // sin(2 w t + f) and its cosine
            const V one = hn::Set(d, 1.0);
            const V s2wt = (sine_wt + sine_wt) * cosine_wt;
            const V c2wt = sm::fnma(d, sine_wt + sine_wt, sine_wt, one);
            const V s2 = sm::fma(d, s2wt, extra.harmonic_cosine, c2wt * extra.harmonic_sine);
            const V c2 = sm::fnma(d, s2wt, extra.harmonic_sine, c2wt * extra.harmonic_cosine);
            V second = side.amplitude * side.angle * extra.ratio;
            RINGLOCK_UNROLL
            for (std::size_t n = 0; n < order; ++n) {
                drive[n] = drive[n] + second * (n % 2 == 0 ? s2 : c2);
                const double sign = n % 2 == 1 ? -2.0 : 2.0;
                second = second * (side.angle * hn::Set(d, sign / static_cast<double>(n + 1)));
            }
            const V swing = couplings[0] * extra.asymmetry;
            couplings[0] = sm::fma(d, swing, cosine_wt, couplings[0]);
            couplings[1] = hn::Neg(swing * side.angle * sine_wt);
            couplings[2] = hn::Neg(swing * side.angle * side.angle * cosine_wt * hn::Set(d, 0.5));
            const V s2x = (sine_x + sine_x) * cosine_x;
            const V c2x = sm::fnma(d, sine_x + sine_x, sine_x, one);
            doubled_sines[0] = sm::fma(d, s2x, extra.second_cosine, c2x * extra.second_sine);
            doubled_cosines[0] = sm::fnma(d, s2x, extra.second_sine, c2x * extra.second_cosine);
        }
        drive[0] = sm::fma(d, side.rate, side.scale_s, drive[0]);
        V sines[order];
        V cosines[order];
        sines[0] = sine_x;
        cosines[0] = cosine_x;
        RINGLOCK_UNROLL
        for (std::size_t n = 0; n < order; ++n) {
            if (n > 0) {
                next(d, n, 1.0, sines, cosines);
                if constexpr (extras) next(d, n, 2.0, doubled_sines, doubled_cosines);
            }
            const auto pulls = [&](std::size_t k) HWY_ATTR {
                if constexpr (extras) return sm::fma(d, extra.second, doubled_sines[k], sines[k]);
                return sines[k];
            };
            if constexpr (extras) {
                V pull = couplings[0] * pulls(n);
                for (std::size_t j = 1; j <= n && j < 3; ++j) pull = sm::fma(d, couplings[j], pulls(n - j), pull);
                lockin[n + 1] = pull;
                rate[n + 1] = drive[n] + pull;
            } else {
                lockin[n + 1] = couplings[0] * pulls(n);
                rate[n + 1] = drive[n] + lockin[n + 1];
            }
        }
    }

    /// Rate of x and its slope `h` scales of time later.
    HWY_INLINE void rate_at(D d, V h, V& value, V& slope) const {
        value = rate[order];
        slope = rate[order] * hn::Set(d, static_cast<double>(order - 1));
        RINGLOCK_UNROLL
        for (std::size_t n = order - 1; n >= 2; --n) {
            value = sm::fma(d, value, h, rate[n]);
            slope = sm::fma(d, slope, h, rate[n] * hn::Set(d, static_cast<double>(n - 1)));
        }
        value = sm::fma(d, value, h, rate[1]);
    }
    HWY_INLINE V rate_at(D d, V h) const {
        V value = rate[order];
        RINGLOCK_UNROLL
        for (std::size_t n = order - 1; n >= 1; --n) value = sm::fma(d, value, h, rate[n]);
        return value;
    }

    /// Gain of x and of the lock-in's share of it in `h` scales of time [rad].
    HWY_INLINE void gains(D d, V h, V& phase, V& lockin_share) const {
        phase = rate[order] * hn::Set(d, 1.0 / static_cast<double>(order));
        lockin_share = lockin[order] * hn::Set(d, 1.0 / static_cast<double>(order));
        RINGLOCK_UNROLL
        for (std::size_t n = order - 1; n >= 1; --n) {
            const V inverse = hn::Set(d, 1.0 / static_cast<double>(n));
            phase = sm::fma(d, phase, h, rate[n] * inverse);
            lockin_share = sm::fma(d, lockin_share, h, lockin[n] * inverse);
        }
        phase = phase * h;
        lockin_share = lockin_share * h;
    }

   private:
    /// n-th Taylor coefficients of sine and cosine of `times` x + a constant: S' = times Q x', Q' = - times S x'.
    HWY_INLINE void next(D d, std::size_t n, double times, V* sines, V* cosines) const {
        // The earliest known terms come first, since the chain of dependencies from term to term takes the time.
        V sum_s = n > 2 ? rate[2] * cosines[n - 2] : hn::Zero(d);
        V sum_c = n > 2 ? rate[2] * sines[n - 2] : hn::Zero(d);
        RINGLOCK_UNROLL
        for (std::size_t j = 3; j < n; ++j) {
            sum_s = sm::fma(d, rate[j], cosines[n - j], sum_s);
            sum_c = sm::fma(d, rate[j], sines[n - j], sum_c);
        }
        sum_s = sm::fma(d, rate[1], cosines[n - 1], sum_s);
        sum_c = sm::fma(d, rate[1], sines[n - 1], sum_c);
        if (n > 1) {
            sum_s = sm::fma(d, rate[n], cosines[0], sum_s);
            sum_c = sm::fma(d, rate[n], sines[0], sum_c);
        }
        sines[n] = sum_s * hn::Set(d, times / static_cast<double>(n));
        cosines[n] = sum_c * hn::Set(d, -times / static_cast<double>(n));
    }
};

/// Sine and cosine of small angles [rad], |angle| <= 1/4: Taylor series, error below 1e-16.
template <class D, class V>
HWY_INLINE void sincos_small(D d, V angle, V& sine, V& cosine) {
    static constexpr double of_sine[] = {-1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880};
    static constexpr double of_cosine[] = {-0.5, 1.0 / 24, -1.0 / 720, 1.0 / 40320, -1.0 / 3628800};
    const V x2 = angle * angle;
    sine = sm::fma(d, angle * x2, sm::polynomial(d, x2, of_sine), angle);
    cosine = sm::fma(d, x2, sm::polynomial(d, x2, of_cosine), hn::Set(d, 1.0));
}

/// Largest step of a series, in its scale: neither time nor phase may go far.
template <class D, class V>
HWY_INLINE V longest_step(D d, V rate) {
    return hn::Set(d, 0.125) / hn::Max(hn::Abs(rate), hn::Set(d, 1.0));
}

/// Whether a step is no longer than that.
template <class D, class V>
HWY_INLINE auto within_step(D d, V step, V rate) {
    return step * hn::Max(hn::Abs(rate), hn::Set(d, 1.0)) <= hn::Set(d, 0.125);
}

/// Estimates from a swing where the dither's amplitude changes from turn to turn.
template <class V>
struct SwingTold {
    V amplitude;      ///< at the turn that ends it
    V rotation_less;  ///< by which the input turns less over a half cycle than was assumed [rad]
};

/// The mean amplitude over a half cycle, which its swing shows less the rotation by the input, is the mean of those at
/// its two turns. An error of the first one would change its sign from turn to turn for ever, and one of the rotation
/// would add up in them. The middles between turns stand on a straight line but for the changes of the amplitude: both
/// errors are corrected with the gains of a line fitted to all middles so far, later to some 512 of them.
/// `sign`: 1 at a minimum of the phase, -1 at a maximum; `turns`: seen before this one, at least one.
template <class D, class V>
HWY_INLINE SwingTold<V> amplitude_after_swing(D d, V mean, V before, V sign, std::int64_t turns) {
    constexpr std::int64_t most = 512;
    const auto j = static_cast<double>(turns < most ? turns : most);
    const double of_line = 2.0 * (2.0 * j - 1.0) / (j * (j + 1.0));
    const double of_slope = turns > 1 ? 6.0 / (j * (j + 1.0)) : 0.0;
    const V plain = (mean + mean) - before;
    const V off = (plain - before) * hn::Set(d, 0.5);
    return {sm::fnma(d, hn::Set(d, of_line), off, plain), sign * off * hn::Set(d, of_slope)};
}

}  // namespace ringlock::gyro::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
