#include "tests/bench/random_and_sincos.hpp"

#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/bench/random_and_sincos.cpp"
#include "engine/random/normal_lanes.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::bench::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

double sincos_sum(const simd::Lanes* rows, std::size_t turns) {
    const hn::CappedTag<double, simd::lanes> d;
    double total = 0.0;
    for (std::size_t lane = 0; lane < simd::lanes; lane += hn::Lanes(d)) {
        auto sum = hn::Zero(d);
        for (std::size_t i = 0; i < turns; ++i) {
            auto sine = hn::Zero(d);
            auto cosine = hn::Zero(d);
            simd::HWY_NAMESPACE::sincos(d, hn::Load(d, rows[i].data() + lane), sine, cosine);
            sum = sum + (sine + cosine);
        }
        alignas(simd::alignment) double values[simd::lanes];
        hn::Store(sum, d, values);
        for (std::size_t k = 0; k < hn::Lanes(d); ++k) total += values[k];
    }
    return total;
}

}  // namespace ringlock::bench::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::bench {

HWY_EXPORT(sincos_sum);

double normal_and_sincos(std::uint64_t seed, std::int64_t first_turn, std::size_t turns) {
    static thread_local std::vector<simd::Lanes> rows;
    rows.resize(turns);
    random::LaneIdentities who;
    who.seed = seed;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = lane;
    random::normals(who, random::Purpose::noise_injection, static_cast<std::uint64_t>(first_turn), turns, simd::lanes,
                    rows.front().data());
    return HWY_DYNAMIC_DISPATCH(sincos_sum)(rows.data(), turns);
}

}  // namespace ringlock::bench
#endif
