#include "analysis/closure/stats/normals_between.hpp"

#include <cstddef>

#include "engine/simd/lanes.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "analysis/closure/stats/normals_between.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::closure::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

/// The probability above z >= 0, with a relative error below 1e-12 up to z = 37; zero beyond.
template <class D, class V>
HWY_INLINE V far_tail(D d, V z) {
    // Chebyshev interpolation of (1 + z) exp(z^2/2) of it in (z - 4)/(z + 4), from quadruple precision
    static constexpr double coefficients[] = {0x1.e361ea6fb866ap-2,   -0x1.8c18f2086e619p-4,  0x1.cabd72c81358fp-7,
                                              0x1.d4969f1153225p-6,   -0x1.07c3c33c709a9p-5,  0x1.25dd71f944fe3p-6,
                                              -0x1.47d5b24a126b9p-8,  -0x1.2b7f39a04c869p-12, 0x1.6c4758ba9638dp-11,
                                              -0x1.8c151d03d68bfp-14, -0x1.6f5970af078f5p-14, 0x1.64b4e035c2d98p-16,
                                              0x1.b90dc84e6318fp-17,  -0x1.d016dd97eca14p-19, -0x1.18e4b9f08ca2dp-19,
                                              0x1.da45fa3315683p-22,  0x1.e15b4df0cd6ddp-23,  -0x1.1e12cc7610d98p-25};
    const V four = hn::Set(d, 4.0);
    const V scaled = sm::polynomial(d, (z - four) / (z + four), coefficients);
    const V square = hn::Set(d, -0.5) * z * z;
    const V least = hn::Set(d, -690.0);
    const V tail = scaled / (z + hn::Set(d, 1.0)) * sm::exp(d, hn::Max(square, least));
    return hn::IfThenElseZero(square > least, tail);
}

template <class D, class V>
HWY_INLINE V upper_tail(D d, V z) {
    const V tail = far_tail(d, hn::Abs(z));
    return hn::IfThenElse(z < hn::Zero(d), hn::Set(d, 1.0) - tail, tail);
}

/// The number above which the given tail lies, from 1e-300 to 1/2 (Wichura, Appl. Stat. 37, 477, 1988, algorithm AS
/// 241, PPND16).
template <class D, class V>
HWY_INLINE V begin_of_tail(D d, V tail) {
    static constexpr double a[] = {3.3871328727963666080e0, 1.3314166789178437745e2, 1.9715909503065514427e3,
                                   1.3731693765509461125e4, 4.5921953931549871457e4, 6.7265770927008700853e4,
                                   3.3430575583588128105e4, 2.5090809287301226727e3};
    static constexpr double b[] = {1.0,
                                   4.2313330701600911252e1,
                                   6.8718700749205790830e2,
                                   5.3941960214247511077e3,
                                   2.1213794301586595867e4,
                                   3.9307895800092710610e4,
                                   2.8729085735721942674e4,
                                   5.2264952788528545610e3};
    static constexpr double c[] = {1.42343711074968357734e0,  4.63033784615654529590e0, 5.76949722146069140550e0,
                                   3.64784832476320460504e0,  1.27045825245236838258e0, 2.41780725177450611770e-1,
                                   2.27238449892691845833e-2, 7.74545014278341407640e-4};
    static constexpr double e[] = {1.0,
                                   2.05319162663775882187e0,
                                   1.67638483018380384940e0,
                                   6.89767334985100004550e-1,
                                   1.48103976427480074590e-1,
                                   1.51986665636164571966e-2,
                                   5.47593808499534494600e-4,
                                   1.05075007164441684324e-9};
    static constexpr double f[] = {6.65790464350110377720e0,  5.46378491116411436990e0,  1.78482653991729133580e0,
                                   2.96560571828504891230e-1, 2.65321895265761230930e-2, 1.24266094738807843860e-3,
                                   2.71155556874348757815e-5, 2.01033439929228813265e-7};
    static constexpr double g[] = {1.0,
                                   5.99832206555887937690e-1,
                                   1.36929880922735805310e-1,
                                   1.48753612908506148525e-2,
                                   7.86869131145613259100e-4,
                                   1.84631831751005468180e-5,
                                   1.42151175831644588870e-7,
                                   2.04426310338993978564e-15};
    const V q = hn::Set(d, 0.5) - tail;
    const V near = hn::Set(d, 0.180625) - q * q;
    const V root = hn::Sqrt(hn::Neg(sm::log(d, tail)));
    const V middle = root - hn::Set(d, 1.6);
    const V far = root - hn::Set(d, 5.0);
    const auto is_near = q <= hn::Set(d, 0.425);
    const auto is_middle = root <= hn::Set(d, 5.0);
    const V above = hn::IfThenElse(is_near, q * sm::polynomial(d, near, a),
                                   hn::IfThenElse(is_middle, sm::polynomial(d, middle, c), sm::polynomial(d, far, f)));
    const V below = hn::IfThenElse(is_near, sm::polynomial(d, near, b),
                                   hn::IfThenElse(is_middle, sm::polynomial(d, middle, e), sm::polynomial(d, far, g)));
    return above / below;
}

template <class D>
HWY_INLINE void between_of(D d, const double* low_of, double width, const double* share_of, double* probability,
                           double* number) {
    using V = hn::Vec<D>;
    const V zero = hn::Zero(d);
    const V low = hn::LoadU(d, low_of);
    const V high = low + hn::Set(d, width);
    const V share = hn::LoadU(d, share_of);
    // The side on which both tails are small numbers.
    const auto turned = low + high < zero;
    const V near = hn::IfThenElse(turned, hn::Neg(high), low);
    const V of_near = upper_tail(d, near);
    const V of_far = far_tail(d, hn::IfThenElse(turned, hn::Neg(low), high));
    const V between = of_near - of_far;
    const V tail = sm::fma(d, hn::IfThenElse(turned, share, hn::Set(d, 1.0) - share), between, of_far);
    const V rest = hn::Set(d, 1.0) - tail;
    const V least = hn::Set(d, 1e-300);
    const V begin = begin_of_tail(d, hn::Max(hn::Min(tail, rest), least));
    const V z = hn::IfThenElse(tail < least, near, hn::IfThenElse(rest < tail, hn::Neg(begin), begin));
    hn::StoreU(between, d, probability);
    hn::StoreU(hn::Max(low, hn::Min(hn::IfThenElse(turned, hn::Neg(z), z), high)), d, number);
}

void fill_between(std::size_t count, const double* low, double width, const double* share, double* probability,
                  double* number) {
    const hn::CappedTag<double, simd::lanes> d;
    const hn::CappedTag<double, 1> one;
    std::size_t k = 0;
    for (; k + hn::Lanes(d) <= count; k += hn::Lanes(d)) {
        between_of(d, low + k, width, share + k, probability + k, number + k);
    }
    for (; k < count; ++k) between_of(one, low + k, width, share + k, probability + k, number + k);
}

}  // namespace ringlock::closure::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::closure {

HWY_EXPORT(fill_between);

void normals_between(std::span<const double> low, double width, std::span<const double> share,
                     std::span<double> probability, std::span<double> number) {
    HWY_DYNAMIC_DISPATCH(fill_between)
    (low.size(), low.data(), width, share.data(), probability.data(), number.data());
}

}  // namespace ringlock::closure
#endif
