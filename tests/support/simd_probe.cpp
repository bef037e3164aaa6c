#include "tests/support/simd_probe.hpp"

#include <stdexcept>
#include <utility>

#include "engine/simd/lanes.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/support/simd_probe.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

#ifndef RINGLOCK_SIMD_PROBE_COEFFICIENTS
#define RINGLOCK_SIMD_PROBE_COEFFICIENTS
namespace ringlock::test {
namespace {

/// Neither symmetric nor of one sign, so that no two of them can be exchanged unnoticed.
constexpr double coefficients[] = {0.75, -1.5, 0.625, 1.125, -0.375, 2.25, -1.875, 0.1, -0.7, 1.3};

template <std::size_t N>
struct First {
    double values[N];
    constexpr First() : values{} {
        for (std::size_t k = 0; k < N; ++k) values[k] = coefficients[k];
    }
};

}  // namespace
}  // namespace ringlock::test
#endif

HWY_BEFORE_NAMESPACE();
namespace ringlock::test::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

void apply(Operation operation, std::size_t count, const double* a, const double* b, const double* c, double* out) {
    const D d;
    for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
        const V x = hn::LoadU(d, a + i);
        const V y = hn::LoadU(d, b + i);
        const V z = hn::LoadU(d, c + i);
        V result = x;
        V other = x;
        switch (operation) {
            case Operation::fma:
                result = sm::fma(d, x, y, z);
                break;
            case Operation::fnma:
                result = sm::fnma(d, x, y, z);
                break;
            case Operation::nearest:
                result = sm::nearest(d, x);
                break;
            case Operation::fraction:
                result = sm::fraction(d, x);
                break;
            case Operation::sine:
                sm::sincos(d, x, result, other);
                break;
            case Operation::cosine:
                sm::sincos(d, x, other, result);
                break;
            case Operation::atan_small:
                result = sm::atan_small(d, x);
                break;
            case Operation::arg_right:
                result = sm::arg_right(d, x, y);
                break;
            case Operation::arg:
                result = sm::arg(d, x, y);
                break;
            case Operation::log:
                result = sm::log(d, x);
                break;
            case Operation::exp:
                result = sm::exp(d, x);
                break;
        }
        hn::StoreU(result, d, out + i);
    }
}

template <std::size_t N>
HWY_INLINE V sum(D d, V x) {
    static constexpr First<N> first;
    return sm::polynomial(d, x, first.values);
}

void apply_polynomial(std::size_t terms, std::size_t count, const double* x, double* out) {
    const D d;
    for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
        const V at = hn::LoadU(d, x + i);
        V result = at;
        switch (terms) {
            case 2:
                result = sum<2>(d, at);
                break;
            case 3:
                result = sum<3>(d, at);
                break;
            case 4:
                result = sum<4>(d, at);
                break;
            case 5:
                result = sum<5>(d, at);
                break;
            case 6:
                result = sum<6>(d, at);
                break;
            case 7:
                result = sum<7>(d, at);
                break;
            case 8:
                result = sum<8>(d, at);
                break;
            case 9:
                result = sum<9>(d, at);
                break;
            case 10:
                result = sum<10>(d, at);
                break;
            default:
                break;
        }
        hn::StoreU(result, d, out + i);
    }
}

}  // namespace ringlock::test::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::test {

HWY_EXPORT(apply);
HWY_EXPORT(apply_polynomial);

namespace {
/// Whole vectors of any instruction set; what is filled in is an argument that every operation takes.
std::size_t pad(std::vector<double>& values, std::size_t count) {
    const std::size_t padded = (count + simd::lanes - 1) / simd::lanes * simd::lanes;
    values.resize(padded, 0.25);
    return padded;
}
}  // namespace

std::vector<double> probe(Operation operation, std::vector<double> a, std::vector<double> b, std::vector<double> c) {
    const std::size_t count = a.size();
    const std::size_t padded = pad(a, count);
    pad(b, count);
    pad(c, count);
    std::vector<double> out(padded);
    HWY_DYNAMIC_DISPATCH(apply)(operation, padded, a.data(), b.data(), c.data(), out.data());
    out.resize(count);
    return out;
}

double probe_coefficient(std::size_t k) { return coefficients[k]; }

std::vector<double> probe_polynomial(std::size_t terms, std::vector<double> x) {
    if (terms < 2 || terms > std::size(coefficients)) throw std::invalid_argument("probe_polynomial: terms");
    const std::size_t count = x.size();
    const std::size_t padded = pad(x, count);
    std::vector<double> out(padded);
    HWY_DYNAMIC_DISPATCH(apply_polynomial)(terms, padded, x.data(), out.data());
    out.resize(count);
    return out;
}

}  // namespace ringlock::test
#endif
