// Elementary functions of vectors, for sources that are compiled once for each instruction set (targets.hpp).
//
// No branch depends on a value, and each operation is rounded the same way on every instruction set, fused
// multiply-adds included: a lane's result does not depend on how many lanes there are. Angles are in fringes, that is
// in units of 2 pi, so that taking whole turns away is exact.
#if defined(RINGLOCK_SIMD_MATH) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGLOCK_SIMD_MATH
#undef RINGLOCK_SIMD_MATH
#else
#define RINGLOCK_SIMD_MATH
#endif

#include <hwy/highway.h>

#include <cmath>
#include <cstdint>

// Series in registers, not in arrays: the compiler does not unroll long loops by itself.
#ifndef RINGLOCK_UNROLL
#define RINGLOCK_UNROLL _Pragma("GCC unroll 16")
#endif

HWY_BEFORE_NAMESPACE();
namespace ringlock::simd::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// a b + c, rounded once.
template <class D, class V>
HWY_INLINE V fma(D d, V a, V b, V c) {
#if HWY_NATIVE_FMA
    (void)d;
    return hn::MulAdd(a, b, c);
#else
    constexpr std::size_t most = 8;
    alignas(64) double x[most];
    alignas(64) double y[most];
    alignas(64) double z[most];
    hn::Store(a, d, x);
    hn::Store(b, d, y);
    hn::Store(c, d, z);
    for (std::size_t i = 0; i < hn::Lanes(d); ++i) x[i] = std::fma(x[i], y[i], z[i]);
    return hn::Load(d, x);
#endif
}

/// c - a b, rounded once.
template <class D, class V>
HWY_INLINE V fnma(D d, V a, V b, V c) {
#if HWY_NATIVE_FMA
    (void)d;
    return hn::NegMulAdd(a, b, c);
#else
    return fma(d, hn::Neg(a), b, c);
#endif
}

/// Sum of coefficients[k] x^k, two terms at least.
template <class D, class V, std::size_t N>
HWY_INLINE V polynomial(D d, V x, const double (&coefficients)[N]) {
    static_assert(N >= 2);
    // Even and odd powers side by side halve the chain of dependent operations.
    const V x2 = x * x;
    V even = hn::Set(d, coefficients[N - 1 - (N - 1) % 2]);
    V odd = hn::Set(d, coefficients[N - 1 - N % 2]);
    RINGLOCK_UNROLL
    for (std::size_t k = N - 1 - (N - 1) % 2; k >= 2; k -= 2) even = fma(d, even, x2, hn::Set(d, coefficients[k - 2]));
    RINGLOCK_UNROLL
    for (std::size_t k = N - 1 - N % 2; k >= 3; k -= 2) odd = fma(d, odd, x2, hn::Set(d, coefficients[k - 2]));
    return fma(d, odd, x, even);
}

/// The nearest whole number to |x| < 2^50, ties to even.
template <class D, class V>
HWY_INLINE V nearest(D d, V x) {
    const V magic = hn::Set(d, 0x1.8p52);
    return (x + magic) - magic;
}

/// `fringes`, |fringes| < 2^50, less the nearest whole number: in [-1/2, 1/2].
template <class D, class V>
HWY_INLINE V fraction(D d, V fringes) {
    return fringes - nearest(d, fringes);
}

/// Sine and cosine of 2 pi `fringes`, |fringes| < 2^48; errors below 2e-16.
template <class D, class V>
HWY_INLINE void sincos(D d, V fringes, V& sine, V& cosine) {
    // sin(x)/x and cos(x) as Taylor series in x^2 for |x| <= pi/4: the last terms are below 1e-17.
    static constexpr double of_sine[] = {-1.0 / 6,        1.0 / 120,          -1.0 / 5040,           1.0 / 362880,
                                         -1.0 / 39916800, 1.0 / 6227020800.0, -1.0 / 1307674368000.0};
    static constexpr double of_cosine[] = {
        -0.5,           1.0 / 24,        -1.0 / 720,           1.0 / 40320,
        -1.0 / 3628800, 1.0 / 479001600, -1.0 / 87178291200.0, 1.0 / 20922789888000.0};
    const hn::Rebind<std::uint64_t, D> bits;
    const V magic = hn::Set(d, 0x1.8p52);
    const V shifted = fma(d, fringes, hn::Set(d, 4.0), magic);
    const auto quarter = hn::BitCast(bits, shifted);  // the low bits count quarter fringes
    const V x = fnma(d, shifted - magic, hn::Set(d, 0.25), fringes) * hn::Set(d, 6.283185307179586);
    const V x2 = x * x;
    const V s = fma(d, x * x2, polynomial(d, x2, of_sine), x);
    const V c = fma(d, x2, polynomial(d, x2, of_cosine), hn::Set(d, 1.0));
    const auto one = hn::Set(bits, 1);
    const auto swap = hn::RebindMask(d, hn::TestBit(quarter, one));
    const auto sine_sign = hn::ShiftLeft<63>(hn::ShiftRight<1>(quarter));
    const auto cosine_sign = hn::ShiftLeft<63>(hn::ShiftRight<1>(quarter + one));
    sine = hn::Xor(hn::IfThenElse(swap, c, s), hn::BitCast(d, sine_sign));
    cosine = hn::Xor(hn::IfThenElse(swap, s, c), hn::BitCast(d, cosine_sign));
}

/// atan(t) [rad] for |t| <= tan(pi/8), error below 1e-16: Chebyshev interpolation of atan(t)/t in t^2, from quadruple
/// precision.
template <class D, class V>
HWY_INLINE V atan_small(D d, V t) {
    static constexpr double coefficients[] = {-0x1.55555555551e4p-2, 0x1.9999999934e5p-3,   -0x1.2492490095732p-3,
                                              0x1.c71c648aca6a2p-4,  -0x1.745baa2843f92p-4, 0x1.3afb01bbe7601p-4,
                                              -0x1.0ffbe63b09941p-4, 0x1.d1fd545f28ae3p-5,  -0x1.64314395b2626p-5,
                                              0x1.5a482e20112ecp-6};
    const V t2 = t * t;
    return fma(d, t * t2, polynomial(d, t2, coefficients), t);
}

/// Angle of the complex number re + i im [rad] where |im| <= tan(3 pi/8) re: the right half plane but for two slices.
/// Error below 3e-16.
template <class D, class V>
HWY_INLINE V arg_right(D d, V re, V im) {
    const V size = hn::Abs(im);
    const auto large = size > hn::Set(d, 0x1.a827999fcef32p-2) * re;  // tan(pi/8)
    // tan(x - pi/4) = (tan x - 1)/(tan x + 1)
    const V numerator = hn::IfThenElse(large, size - re, size);
    const V denominator = hn::IfThenElse(large, size + re, re);
    const V angle = atan_small(d, numerator / denominator);
    const V turned = angle + hn::IfThenElseZero(large, hn::Set(d, 0x1.921fb54442d18p-1));
    return hn::CopySign(turned, im);
}

/// Angle of the complex number re + i im [rad], in [-pi, pi]; 0 for 0. Error below 5e-16 where the larger part is
/// between 2^-1000 and 2^1022.
template <class D, class V>
HWY_INLINE V arg(D d, V re, V im) {
    const V x = hn::Abs(re);
    const V y = hn::Abs(im);
    const auto steep = y > x;
    const V low = hn::IfThenElse(steep, x, y);
    const V high = hn::Max(hn::IfThenElse(steep, y, x), hn::Set(d, 0x1p-1000));
    const V first = arg_right(d, high, low);
    const V second = hn::IfThenElse(steep, hn::Set(d, 0x1.921fb54442d18p0) - first, first);
    const V third = hn::IfThenElse(re < hn::Zero(d), hn::Set(d, 0x1.921fb54442d18p1) - second, second);
    return hn::CopySign(third, im);
}

/// A complex number in each lane.
template <class V>
struct Complex {
    V re;
    V im;
};

template <class D, class V>
HWY_INLINE Complex<V> mul(D d, Complex<V> a, Complex<V> b) {
    return {fnma(d, a.im, b.im, a.re * b.re), fma(d, a.im, b.re, a.re * b.im)};
}

/// a b + c.
template <class D, class V>
HWY_INLINE Complex<V> mul_add(D d, Complex<V> a, Complex<V> b, Complex<V> c) {
    return {fnma(d, a.im, b.im, fma(d, a.re, b.re, c.re)), fma(d, a.im, b.re, fma(d, a.re, b.im, c.im))};
}

template <class D, class V>
HWY_INLINE V norm(D d, Complex<V> a) {
    return fma(d, a.im, a.im, a.re * a.re);
}

/// Natural logarithm of normal positive numbers, error below 3e-16 + 2e-16 |log|.
template <class D, class V>
HWY_INLINE V log(D d, V x) {
    // x = 2^k m with m from sqrt(1/2) to sqrt(2); log m = 2 atanh((m - 1)/(m + 1)).
    static constexpr double of_atanh[] = {2.0 / 3,  2.0 / 5,  2.0 / 7,  2.0 / 9,  2.0 / 11,
                                          2.0 / 13, 2.0 / 15, 2.0 / 17, 2.0 / 19, 2.0 / 21};
    const hn::Rebind<std::uint64_t, D> bits;
    const auto root_half = hn::Set(bits, 0x3fe6a09e667f3bcdULL);
    const auto one = hn::Set(bits, 0x3ff0000000000000ULL);
    const auto raised = hn::BitCast(bits, x) + (one - root_half);
    const auto exponent = hn::ShiftRight<52>(raised);
    const auto mantissa = hn::And(raised, hn::Set(bits, 0x000fffffffffffffULL)) + root_half;
    const V m = hn::BitCast(d, mantissa);
    // A whole number below 2^52 as a double: put it into the mantissa of 2^52.
    const V k = hn::BitCast(d, hn::Or(exponent, hn::Set(bits, 0x4330000000000000ULL))) - hn::Set(d, 0x1p52 + 1023.0);
    const V s = (m - hn::Set(d, 1.0)) / (m + hn::Set(d, 1.0));
    const V s2 = s * s;
    const V log_m = fma(d, s * s2, polynomial(d, s2, of_atanh), s + s);
    return fma(d, k, hn::Set(d, 0x1.62e42fefa39efp-1), log_m);
}

/// e^x for |x| <= 700, relative error below 4e-16.
template <class D, class V>
HWY_INLINE V exp(D d, V x) {
    // x = k log 2 + r, |r| <= log(2)/2; Taylor series of (e^r - 1 - r)/r^2, whose next term is below 3e-18.
    static constexpr double of_rest[] = {1.0 / 2,
                                         1.0 / 6,
                                         1.0 / 24,
                                         1.0 / 120,
                                         1.0 / 720,
                                         1.0 / 5040,
                                         1.0 / 40320,
                                         1.0 / 362880,
                                         1.0 / 3628800,
                                         1.0 / 39916800,
                                         1.0 / 479001600.0,
                                         1.0 / 6227020800.0,
                                         1.0 / 87178291200.0};
    const hn::Rebind<std::uint64_t, D> bits;
    const V magic = hn::Set(d, 0x1.8p52);
    const V shifted = fma(d, x, hn::Set(d, 0x1.71547652b82fep+0), magic);
    const V k = shifted - magic;
    // log 2 in two parts, the first of few bits
    const V r = fnma(d, k, hn::Set(d, 0x1.ef35793c76730p-45), fnma(d, k, hn::Set(d, 0x1.62e42fefa3800p-1), x));
    const V rest = fma(d, r * r, polynomial(d, r, of_rest), r);
    const auto scale = hn::ShiftLeft<52>(hn::BitCast(bits, shifted)) + hn::Set(bits, 0x3ff0000000000000ULL);
    return hn::BitCast(d, scale) * (rest + hn::Set(d, 1.0));
}

}  // namespace ringlock::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
