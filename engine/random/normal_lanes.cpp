#include "engine/random/normal_lanes.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/random/normal_lanes.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::random::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

/// The low halves of 64-bit lanes hold the words of Philox; the high halves are arbitrary.
template <class V>
struct Words {
    V w0, w1, w2, w3;
};

/// Product of the low halves of 64-bit lanes with a word.
template <class D, class V>
HWY_INLINE V product(D d, V word, std::uint64_t multiplier) {
#if HWY_TARGET == HWY_SCALAR
    return hn::Set(d, (hn::GetLane(word) & 0xFFFFFFFFU) * multiplier);
#else
    const hn::Repartition<std::uint32_t, D> halves;
    return hn::MulEven(hn::BitCast(halves, word), hn::BitCast(halves, hn::Set(d, multiplier)));
#endif
}

template <class V, class D>
HWY_INLINE Words<V> philox(D d, Words<V> c, std::uint32_t key0, std::uint32_t key1) {
    for (int round = 0; round < 10; ++round) {
        const V p0 = product(d, c.w0, 0xD2511F53U);
        const V p1 = product(d, c.w2, 0xCD9E8D57U);
        c = {hn::Xor(hn::Xor(hn::ShiftRight<32>(p1), c.w1), hn::Set(d, std::uint64_t{key0})), p1,
             hn::Xor(hn::Xor(hn::ShiftRight<32>(p0), c.w3), hn::Set(d, std::uint64_t{key1})), p0};
        key0 += 0x9E3779B9U;
        key1 += 0xBB67AE85U;
    }
    return c;
}

/// 52 bits of two words as a number in [1, 2).
template <class D, class V>
HWY_INLINE hn::Vec<hn::Rebind<double, D>> one_to_two(D d, V high, V low) {
    const hn::Rebind<double, D> real;
    const V bits =
        hn::Or(hn::ShiftRight<12>(hn::ShiftLeft<32>(high)), hn::ShiftRight<12>(hn::And(low, hn::Set(d, 0xFFFFFFFFU))));
    return hn::BitCast(real, hn::Or(bits, hn::Set(d, 0x3FF0000000000000U)));
}

void fill_normals(const LaneIdentities& who, Purpose purpose, std::uint64_t first_step, std::size_t steps,
                  std::size_t lanes, double* HWY_RESTRICT out, std::size_t pair_stride) {
    const hn::CappedTag<double, simd::lanes> d;
    const hn::Rebind<std::uint64_t, decltype(d)> bits;
    const std::size_t width = hn::Lanes(d);
    const auto key0 = static_cast<std::uint32_t>(who.seed);
    const auto key1 = static_cast<std::uint32_t>(who.seed >> 32);
    for (std::size_t lane = 0; lane < lanes; lane += width) {
        const auto gyro = hn::LoadU(bits, who.gyro.data() + lane);
        // Gyros beyond 2^32 go on in the upper bits of the last word, above the purpose.
        const auto last =
            hn::Or(hn::ShiftLeft<8>(hn::ShiftRight<32>(gyro)), hn::Set(bits, static_cast<std::uint64_t>(purpose)));
        const std::uint64_t end = first_step + steps;
        for (std::uint64_t step = first_step & ~std::uint64_t{1}; step < end; step += 2 * pair_stride) {
            const std::uint64_t pair = step >> 1;
            using Bits = hn::Vec<decltype(bits)>;
            const auto words =
                philox<Bits>(bits, {hn::Set(bits, pair), hn::Set(bits, pair >> 32), gyro, last}, key0, key1);
            const auto uniform = hn::Set(d, 2.0) - one_to_two(bits, words.w0, words.w1);  // in (0, 1]
            const auto angle = one_to_two(bits, words.w2, words.w3);
            const auto radius = hn::Sqrt(hn::Set(d, -2.0) * sm::log(d, uniform));
            hn::Vec<decltype(d)> sine;
            hn::Vec<decltype(d)> cosine;
            sm::sincos(d, angle, sine, cosine);
            if (step >= first_step) hn::Store(radius * cosine, d, out + (step - first_step) * simd::lanes + lane);
            if (step + 1 < end) hn::Store(radius * sine, d, out + (step + 1 - first_step) * simd::lanes + lane);
        }
    }
}

}  // namespace ringlock::random::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::random {

HWY_EXPORT(fill_normals);

void normals(const LaneIdentities& who, Purpose purpose, std::uint64_t first_step, std::size_t steps, std::size_t lanes,
             double* out, std::size_t pair_stride) {
    HWY_DYNAMIC_DISPATCH(fill_normals)(who, purpose, first_step, steps, lanes, out, pair_stride);
}

double normal(Identity who, Purpose purpose, std::uint64_t step) {
    LaneIdentities lanes;
    lanes.seed = who.seed;
    lanes.gyro[0] = who.gyro;
    simd::Lanes out;
    normals(lanes, purpose, step, 1, 1, out.data());
    return out[0];
}

}  // namespace ringlock::random
#endif
