// The path of the phase near a turn in vector lanes, for sources that are compiled once for each instruction set.
#if defined(RINGLOCK_TURN_SERIES) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGLOCK_TURN_SERIES
#undef RINGLOCK_TURN_SERIES
#else
#define RINGLOCK_TURN_SERIES
#endif

#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::gyro::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

/// A half cycle next to a turn, turned upright (x = psi + coupling phase at minima, its negative at maxima):
///
///     x' = rate + A w (sin(w t) + ratio sin(2 w t + f)) + b (1 + asymmetry cos(w t)) F(x),
///     F = sin(x) + p sin(2 x) + q cos(2 x),
///
/// t from the dither's turn, in either direction. p = r cos(h) and q = +-r sin(h) (negative at maxima) make a second
/// harmonic r sin(2 (psi + coupling phase) + h) of the coupling.
template <class V>
struct UprightSide {
    V amplitude, w, rate, b;
    V ratio, harmonic_sine, harmonic_cosine;  ///< of f
    V asymmetry;
    bool second = false;  ///< p and q are not all zero
    V second_sine, second_cosine;

    /// F(x) from sine and cosine of x.
    template <class D>
    HWY_INLINE V coupling(D d, V sine_x, V cosine_x) const {
        if (!second) return sine_x;
        const V doubled = sine_x + sine_x;
        return sine_x + sm::fma(d, second_sine, doubled * cosine_x,
                                second_cosine * sm::fnma(d, doubled, sine_x, hn::Set(d, 1.0)));
    }
};

/// Taylor series of x and of the lock-in's share of it, around a point of the path. The unit of time is 1/(w sqrt(A)),
/// in which the drive's acceleration is one. With steps as long as longest_step() allows what is left out is below
/// 1e-10 rad at the paper's device, and grows with b.
template <class D, class V = hn::Vec<D>>
struct TurnSeries {
    static constexpr std::size_t order = 9;
    V scale_s;
    V rate[order + 1];    ///< n times the n-th coefficient of x
    V lockin[order + 1];  ///< n times that of the lock-in's share

    /// Around time `time` (in units of the scale, by the sine and cosine of w t) and phase x (by sine and cosine).
    HWY_INLINE void expand(D d, const UprightSide<V>& side, V scale, V sine_wt, V cosine_wt, V sine_x, V cosine_x) {
        scale_s = scale;
        const V zero = hn::Zero(d);
        const V angle = side.w * scale;
        // sin(2 w t + f) and its cosine
        const V doubled_sine = (sine_wt + sine_wt) * cosine_wt;
        const V doubled_cosine = sm::fnma(d, sine_wt + sine_wt, sine_wt, hn::Set(d, 1.0));
        const V s2 = sm::fma(d, doubled_sine, side.harmonic_cosine, doubled_cosine * side.harmonic_sine);
        const V c2 = sm::fnma(d, doubled_sine, side.harmonic_sine, doubled_cosine * side.harmonic_cosine);
        V first = side.amplitude * angle;
        V second = first * side.ratio;
        V drive[order];
        for (std::size_t n = 0; n < order; ++n) {
            const V sine = n % 4 == 0   ? sine_wt
                           : n % 4 == 1 ? cosine_wt
                           : n % 4 == 2 ? hn::Neg(sine_wt)
                                        : hn::Neg(cosine_wt);
            const V doubled = n % 4 == 0 ? s2 : n % 4 == 1 ? c2 : n % 4 == 2 ? hn::Neg(s2) : hn::Neg(c2);
            drive[n] = sm::fma(d, first, sine, second * doubled);
            const V factor = angle * hn::Set(d, 1.0 / static_cast<double>(n + 1));
            first = first * factor;
            second = second * (factor + factor);
        }
        drive[0] = sm::fma(d, side.rate, scale, drive[0]);
        const V beta = side.b * scale;
        const V swing = beta * side.asymmetry;
        const V couplings[3] = {sm::fma(d, swing, cosine_wt, beta), hn::Neg(swing * angle * sine_wt),
                                hn::Neg(swing * angle * angle * cosine_wt * hn::Set(d, 0.5))};
        V sines[order];
        V cosines[order];
        V forces[order];  // of F
        sines[0] = sine_x;
        cosines[0] = cosine_x;
        rate[0] = zero;
        lockin[0] = zero;
        for (std::size_t n = 0; n < order; ++n) {
            if (n > 0) {
                V sum_s = rate[1] * cosines[n - 1];
                V sum_c = rate[1] * sines[n - 1];
                for (std::size_t j = 2; j <= n; ++j) {
                    sum_s = sm::fma(d, rate[j], cosines[n - j], sum_s);
                    sum_c = sm::fma(d, rate[j], sines[n - j], sum_c);
                }
                const V inverse = hn::Set(d, 1.0 / static_cast<double>(n));
                sines[n] = sum_s * inverse;
                cosines[n] = hn::Neg(sum_c * inverse);
            }
            if (side.second) {
                V ss = sines[0] * sines[n];
                V sc = sines[0] * cosines[n];
                for (std::size_t j = 1; j <= n; ++j) {
                    ss = sm::fma(d, sines[j], sines[n - j], ss);
                    sc = sm::fma(d, sines[j], cosines[n - j], sc);
                }
                const V doubled_c = hn::Set(d, n == 0 ? 1.0 : 0.0) - (ss + ss);
                forces[n] = sines[n] + sm::fma(d, side.second_sine, sc + sc, side.second_cosine * doubled_c);
            } else {
                forces[n] = sines[n];
            }
            V pull = couplings[0] * forces[n];
            for (std::size_t j = 1; j <= n && j < 3; ++j) pull = sm::fma(d, couplings[j], forces[n - j], pull);
            lockin[n + 1] = pull;
            rate[n + 1] = drive[n] + pull;
        }
    }

    /// Rate of x and its slope `h` scales of time later.
    HWY_INLINE void rate_at(D d, V h, V& value, V& slope) const {
        value = rate[order];
        slope = rate[order] * hn::Set(d, static_cast<double>(order - 1));
        for (std::size_t n = order - 1; n >= 2; --n) {
            value = sm::fma(d, value, h, rate[n]);
            slope = sm::fma(d, slope, h, rate[n] * hn::Set(d, static_cast<double>(n - 1)));
        }
        value = sm::fma(d, value, h, rate[1]);
    }

    /// What x and the lock-in's share of it gain in `h` scales of time [rad].
    HWY_INLINE void gains(D d, V h, V& phase, V& lockin_share) const {
        phase = rate[order] * hn::Set(d, 1.0 / static_cast<double>(order));
        lockin_share = lockin[order] * hn::Set(d, 1.0 / static_cast<double>(order));
        for (std::size_t n = order - 1; n >= 1; --n) {
            const V inverse = hn::Set(d, 1.0 / static_cast<double>(n));
            phase = sm::fma(d, phase, h, rate[n] * inverse);
            lockin_share = sm::fma(d, lockin_share, h, lockin[n] * inverse);
        }
        phase = phase * h;
        lockin_share = lockin_share * h;
    }
};

/// Sine and cosine of small angles [rad], |angle| <= 3/8: Taylor series to the thirteenth order, error below 1e-17.
template <class D, class V>
HWY_INLINE void sincos_small(D d, V angle, V& sine, V& cosine) {
    static constexpr double of_sine[] = {-1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800};
    static constexpr double of_cosine[] = {-0.5, 1.0 / 24, -1.0 / 720, 1.0 / 40320, -1.0 / 3628800, 1.0 / 479001600};
    const V x2 = angle * angle;
    sine = sm::fma(d, angle * x2, sm::polynomial(d, x2, of_sine), angle);
    cosine = sm::fma(d, x2, sm::polynomial(d, x2, of_cosine), hn::Set(d, 1.0));
}

/// Largest step of a series, in its scale: neither time nor phase may go far.
template <class D, class V>
HWY_INLINE V longest_step(D d, V rate) {
    return hn::Set(d, 0.25) / hn::Max(hn::Abs(rate), hn::Set(d, 1.0));
}

}  // namespace ringlock::gyro::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
