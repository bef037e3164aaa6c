#include "engine/readout/pulse_alignment.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/readout/pulse_alignment.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::readout::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

constexpr double memory_cycles = 512.0;  // of the mean rate

void align_lanes(std::size_t lanes, const PulseAlignment::Known& known, PulseAlignment::State& state,
                 LaneReadings& readings) {
    const D d;
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    const V half = hn::Set(d, 0.5);
    const V two_pi = hn::Set(d, 6.283185307179586);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const V b = load(known.b_rad_s);
        const V phase_sine = load(known.coupling_sine);
        const V phase_cosine = load(known.coupling_cosine);
        const V rate_per_gain = two_pi * load(known.inverse_period_s);
        V last_fringes = load(state.last_fringes);
        V last_whole = load(state.last_whole);
        V last_gain = load(state.last_gain);
        V cycle_gain = load(state.cycle_gain);
        V cycles = load(state.cycles);
        for (std::size_t i = 0; i < readings.turns; ++i) {
            const bool minimum = readings.minimum(i);
            const V sign = hn::Set(d, minimum ? 1.0 : -1.0);
            const std::int64_t before_turns = state.turns + static_cast<std::int64_t>(i);
            const V fringes = load(readings.phase_fringes[i]);
            const V whole = load(readings.phase_whole[i]);
            if (before_turns > 0) {
                const V gain = (whole - last_whole) + (fringes - last_fringes);
                if (before_turns > 1) {
                    cycles = hn::Min(cycles + one, hn::Set(d, memory_cycles));
                    cycle_gain = cycle_gain + (gain + last_gain - cycle_gain) / cycles;
                }
                last_gain = gain;
            }
            last_fringes = fringes;
            last_whole = whole;

            const V raw_sine = load(readings.sine[i]);
            const V raw_cosine = load(readings.cosine[i]);
            const V sine = sm::fma(d, raw_cosine, phase_sine, raw_sine * phase_cosine);
            const V cosine = sm::fnma(d, raw_sine, phase_sine, raw_cosine * phase_cosine);
            const V doubled_sine = (sine + sine) * cosine;
            const V doubled_cosine = sm::fnma(d, sine + sine, sine, one);
            const V second =
                sm::fma(d, doubled_sine, load(known.second_cosine), doubled_cosine * load(known.second_sine));
            const V pull = sm::fma(d, load(known.second_ratio), second, sine);
            const V threshold = b * sm::fma(d, sign, load(known.turn_asymmetry), one);
            const V rate = sign * sm::fma(d, threshold, pull, cycle_gain * rate_per_gain);

            const simd::Lanes(&accelerations)[2] = known.acceleration_rad_s2[minimum ? 0 : 1];
            const V before = load(accelerations[0]);
            const V after = load(accelerations[1]);
            const auto late = rate < zero;  // a minimum whose phase still falls lies after the dither's turn
            const V here = hn::IfThenElse(late, after, before);
            const V there = hn::IfThenElse(late, before, after);
            const V excess = (here - there) / there;
            const V t0 = hn::Neg(rate) / here;
            const V moved = t0 * excess;
            const V shallower = half * t0 * t0 * here * excess;
            const V gone = (shallower + shallower) / there;  // in squares of times
            for (std::size_t side = 0; side < 2; ++side) {
                const auto other = side == 0 ? late : hn::Not(late);
                for (auto& column : readings.pulses.time_s[side]) {
                    const V seen = load(column[i]);
                    const V time = seen - moved;
                    const V share = hn::Max(one - gone / hn::Max(time * time, hn::Set(d, 1e-300)), zero);
                    const V aligned = time * hn::Sqrt(share);
                    // 0 says that there is no such pulse.
                    store(hn::IfThenElse(hn::And(other, seen != zero), aligned, seen), column[i]);
                }
            }
        }
        store(last_fringes, state.last_fringes);
        store(last_whole, state.last_whole);
        store(last_gain, state.last_gain);
        store(cycle_gain, state.cycle_gain);
        store(cycles, state.cycles);
    }
}

}  // namespace ringlock::readout::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::readout {

HWY_EXPORT(align_lanes);

PulseAlignment::PulseAlignment(std::span<const gyro::Device> devices) : lanes_(devices.size()) {
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const gyro::Device& device = devices[std::min(lane, devices.size() - 1)];
        const gyro::Coupling& coupling = device.coupling;
        asymmetric_ = asymmetric_ || device.positive_duration_s != device.negative_duration_s;
        for (const std::size_t which : {0U, 1U}) {
            for (const std::size_t side : {0U, 1U}) {
                const double half_sign = (which == 0) == (side == 1) ? 1.0 : -1.0;
                const gyro::HalfCycle half = device.half_cycle(half_sign, device.dither_amplitude_rad);
                known_.acceleration_rad_s2[which][side][lane] = half.end_acceleration_rad_s2(side == 0 ? 1 : 0);
            }
        }
        known_.b_rad_s[lane] = coupling.b_rad_s;
        known_.turn_asymmetry[lane] = coupling.turn_asymmetry;
        known_.coupling_sine[lane] = std::sin(coupling.phase_rad);
        known_.coupling_cosine[lane] = std::cos(coupling.phase_rad);
        known_.second_ratio[lane] = coupling.second_ratio;
        known_.second_sine[lane] = std::sin(coupling.second_from_first_rad());
        known_.second_cosine[lane] = std::cos(coupling.second_from_first_rad());
        known_.inverse_period_s[lane] = 1.0 / device.period_s();
    }
}

void PulseAlignment::align(LaneReadings& readings) {
    if (!asymmetric_) return;
    HWY_DYNAMIC_DISPATCH(align_lanes)(lanes_, known_, state_, readings);
    state_.turns += static_cast<std::int64_t>(readings.turns);
}

}  // namespace ringlock::readout
#endif
