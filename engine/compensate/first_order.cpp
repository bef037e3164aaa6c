#include "engine/compensate/first_order.hpp"

#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/compensate/first_order.cpp"
#include "engine/core/units.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/compensate/acceleration_average-inl.hpp"
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::compensate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

using Average = AverageOf<V>;

void observe_lanes(std::size_t lanes, const readout::LaneReadings& readings, FirstOrder::State& state,
                   LaneErrors& errors) {
    const D d;
    const V zero = hn::Zero(d);
    const V tiny = hn::Set(d, 1e-300);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        Average average[4];
        for (std::size_t k = 0; k < 4; ++k) average[k] = {load(state.mean_rad_s2[k]), load(state.count[k])};
        V after_last = load(state.after_last_fringes);
        V error = load(state.error_fringes);
        const V scale = load(state.scale_fringes);
        store(load(state.error_whole), errors.whole);
        for (std::size_t i = 0; i < readings.turns; ++i) {
            const V sine = load(readings.sine[i]);
            const V cosine = load(readings.cosine[i]);
            const bool minimum = readings.minimum(i);
            // sin +- cos of the phase; the detectors' common scale drops out.
            const V size2 = hn::Max(sm::fma(d, sine, sine, cosine * cosine), tiny);
            const V projection = scale * (minimum ? sine + cosine : sine - cosine);
            const auto half_kick = [&](Average& of, V acceleration) HWY_ATTR {
                const V a = of.update(d, acceleration);
                return hn::IfThenElseZero(a > zero, projection / hn::Sqrt(hn::Max(a, tiny) * size2));
            };
            Average* const sides = average + (minimum ? 0 : 2);
            if (errors.middles) store(error + after_last, errors.middle_fringes[i]);
            error = error + (after_last + half_kick(sides[0], load(readings.accel_before_rad_s2[i])));
            after_last = half_kick(sides[1], load(readings.accel_after_rad_s2[i]));
            store(error, errors.fringes[i]);
        }
        const V whole = sm::nearest(d, error);
        store(error - whole, state.error_fringes);
        store(load(state.error_whole) + whole, state.error_whole);
        store(after_last, state.after_last_fringes);
        for (std::size_t k = 0; k < 4; ++k) {
            store(average[k].mean, state.mean_rad_s2[k]);
            store(average[k].count, state.count[k]);
        }
    }
}

}  // namespace ringlock::compensate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::compensate {

HWY_EXPORT(observe_lanes);

FirstOrder::FirstOrder(const Calibration& calibration, double factor) : lanes_(calibration.lanes) {
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
        state_.scale_fringes[lane] = factor * calibration.b_rad_s[lane] * std::sqrt(units::pi) / units::two_pi;
    }
}

void FirstOrder::observe(const readout::LaneReadings& readings, LaneErrors& errors) {
    errors.resize(readings.turns);
    HWY_DYNAMIC_DISPATCH(observe_lanes)(lanes_, readings, state_, errors);
}

}  // namespace ringlock::compensate
#endif
