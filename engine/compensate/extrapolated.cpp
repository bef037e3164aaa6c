#include "engine/compensate/extrapolated.hpp"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/compensate/extrapolated.cpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::compensate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

constexpr double model_rad = 1e-6;  // keeps the weights of a noiseless instrument finite

void observe_lanes(std::size_t lanes, const readout::Electronics& electronics, const readout::LaneReadings& readings,
                   Extrapolated::State& state, LaneErrors& errors) {
    const D d;
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    const V half = hn::Set(d, 0.5);
    const V per_rad = hn::Set(d, 0.15915494309189535);
    const V quarter_rad = hn::Set(d, 1.5707963267948966);
    const double noise = electronics.ideal ? 0.0 : electronics.comparator_noise_relative;
    const double clock_hz = electronics.ideal ? 0.0 : electronics.clock_hz;
    const V pulse_variance = hn::Set(d, noise * noise + model_rad * model_rad);
    const V tick_variance = hn::Set(d, clock_hz > 0.0 ? 1.0 / (12.0 * clock_hz * clock_hz) : 0.0);
    const V hysteresis = hn::Set(d, electronics.ideal ? 0.0 : electronics.comparator_hysteresis_relative);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const V a_of[2] = {load(state.acceleration_rad_s2[0]), load(state.acceleration_rad_s2[1])};
        const V curve_of[2] = {load(state.curve_per_rad[0]), load(state.curve_per_rad[1])};
        V error = load(state.error_fringes);
        V error_whole = load(state.error_whole);
        const V whole_before = error_whole;
        store(whole_before, errors.whole);
        for (std::size_t i = 0; i < readings.turns; ++i) {
            const bool minimum = readings.minimum(i);
            const V sign = hn::Set(d, minimum ? 1.0 : -1.0);
            const V upright = sign * load(readings.phase_fringes[i]) * hn::Set(d, 4.0);
            const V near = (load(readings.pulses.first_quarter[i]) - upright) * quarter_rad;
            V s0[2], s1[2], sy[2];
            V tau_numerator = zero;
            V tau_denominator = zero;
            V fewest = hn::Set(d, static_cast<double>(readout::kept_pulses));
            V most = zero;
            for (const std::size_t side : {0U, 1U}) {
                // A half cycle of positive sign begins at a minimum.
                const std::size_t which = minimum == (side == 1) ? 0 : 1;
                const V a = a_of[which];
                V s2 = zero;
                V sgy = zero;
                V distinct = zero;
                s0[side] = s1[side] = sy[side] = zero;
                for (std::size_t pulse = 0; pulse < readout::kept_pulses; ++pulse) {
                    const V time = load(readings.pulses.time_s[side][pulse][i]);
                    const V nominal = sm::fma(d, hn::Set(d, static_cast<double>(pulse)), quarter_rad, near);
                    const V distance = side == 0 ? nominal - hysteresis : nominal + hysteresis;
                    const V factor = sm::fma(d, curve_of[which], distance, one);
                    const V slope = a * time / (factor * factor);
                    const V y = sm::fma(d, half * slope, time, hn::Neg(distance));
                    const V rate2 = hn::Max(distance + distance, zero) * a;
                    const V variance = sm::fma(d, rate2, tick_variance, pulse_variance);
                    const V weight = hn::IfThenElseZero(time != zero, one / variance);
                    distinct = distinct + hn::IfThenElseZero(time != zero, one);
                    const V weighted = weight * slope;
                    s0[side] = s0[side] + weight;
                    s1[side] = s1[side] + weighted;
                    sy[side] = sm::fma(d, weight, y, sy[side]);
                    s2 = sm::fma(d, weighted, slope, s2);
                    sgy = sm::fma(d, weighted, y, sgy);
                }
                fewest = hn::Min(fewest, distinct);
                most = hn::Max(most, distinct);
                const V mean_slope = s1[side] / s0[side];
                tau_numerator = tau_numerator + sm::fnma(d, mean_slope, sy[side], sgy);
                tau_denominator = tau_denominator + sm::fnma(d, mean_slope, s1[side], s2);
            }
            const V tau = tau_numerator / tau_denominator;
            const V before = sm::fma(d, s1[0], tau, hn::Neg(sy[0])) / s0[0];
            const V after = sm::fma(d, s1[1], tau, hn::Neg(sy[1])) / s0[1];
            // Phase and instant of the turn take a pulse on either side and one more; without these there is no
            // estimate.
            const auto enough = hn::And(fewest >= one, most >= one + one);
            const V half_kick = hn::IfThenElseZero(enough, half * per_rad * sign * (after - before));
            if (errors.middles) store(error + (error_whole - whole_before), errors.middle_fringes[i]);
            const V here = error + half_kick;
            store(here + (error_whole - whole_before), errors.fringes[i]);
            error = here + half_kick;
            // Whole fringes are put apart at every turn: bits must not depend on where a piece ends.
            const V carry = sm::nearest(d, error);
            error = error - carry;
            error_whole = error_whole + carry;
        }
        store(error, state.error_fringes);
        store(error_whole, state.error_whole);
    }
}

}  // namespace ringlock::compensate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::compensate {

HWY_EXPORT(observe_lanes);

Extrapolated::Extrapolated(const Calibration& calibration, const readout::Electronics& electronics)
    : lanes_(calibration.lanes), electronics_(electronics), state_{} {
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const std::size_t which = std::min(lane, calibration.lanes - 1);
        for (const std::size_t side : {0U, 1U}) {
            const double duration_s =
                side == 0 ? calibration.positive_duration_s[which] : calibration.negative_duration_s[which];
            const double w = units::pi / duration_s;
            const double a = calibration.dither_amplitude_rad[which] * w * w;
            state_.acceleration_rad_s2[side][lane] = a;
            state_.curve_per_rad[side][lane] = w * w / (12.0 * a);
        }
    }
}

void Extrapolated::observe(const readout::LaneReadings& readings, LaneErrors& errors) {
    errors.resize(readings.turns);
    errors.whole = state_.error_whole;
    if (readings.turns == 0) return;
    if (readings.pulses.empty()) throw RunError("compensated_extrapolated: the readings have no pulses");
    HWY_DYNAMIC_DISPATCH(observe_lanes)(lanes_, electronics_, readings, state_, errors);
}

}  // namespace ringlock::compensate
#endif
