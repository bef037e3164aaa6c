#include "engine/ensemble/output_counts.hpp"

#include <cmath>
#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/ensemble/output_counts.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::ensemble::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

void count(const readout::LaneAngles& angles, const compensate::LaneErrors* errors, std::size_t turns,
           std::size_t stride, std::vector<simd::LaneCounts>& counts) {
    const hn::CappedTag<double, simd::lanes> d;
    const hn::Rebind<std::int64_t, decltype(d)> di;
    // Whole numbers below 2^51 stand in the low bits once this is added.
    const auto magic = hn::Set(d, 0x1.8p52);
    const auto bias = hn::BitCast(di, magic);
    for (std::size_t lane = 0; lane < simd::lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        for (std::size_t i = 0; i < turns; i += stride) {
            auto fringes = load(angles.angle_fringes[i]);
            auto whole = load(angles.angle_whole[i]);
            if (errors != nullptr) {
                fringes = fringes - load(errors->fringes[i]);
                whole = whole - load(errors->whole);
            }
            const auto fine = hn::BitCast(di, fringes * hn::Set(d, counts_per_fringe) + magic) - bias;
            const auto coarse = hn::ShiftLeft<32>(hn::BitCast(di, whole + magic) - bias);
            hn::Store(coarse + fine, di, counts[i / stride].data() + lane);
        }
    }
}

}  // namespace ringlock::ensemble::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::ensemble {

HWY_EXPORT(count);

void output_counts(const readout::LaneAngles& angles, const compensate::LaneErrors* errors, std::size_t turns,
                   std::vector<simd::LaneCounts>& counts, std::size_t stride) {
    counts.resize((turns + stride - 1) / stride);
    HWY_DYNAMIC_DISPATCH(count)(angles, errors, turns, stride, counts);
}

std::int64_t counts_of(double fringes) {
    // Whole fringes apart, so that many of them wrap round and do not overflow.
    const double whole = std::nearbyint(fringes);
    const auto coarse =
        static_cast<std::uint64_t>(static_cast<std::int64_t>(whole)) * static_cast<std::uint64_t>(counts_per_fringe);
    const auto fine = static_cast<std::uint64_t>(std::llround((fringes - whole) * counts_per_fringe));
    return static_cast<std::int64_t>(coarse + fine);
}

}  // namespace ringlock::ensemble
#endif
