#include "engine/compensate/two_train.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/compensate/two_train.cpp"
#include "engine/core/units.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/compensate/acceleration_average-inl.hpp"
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::compensate::HWY_NAMESPACE {

namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;
using Average = AverageOf<V>;

constexpr std::int64_t turns_between_solutions = 128;
// Trains that are nearly parallel do not distinguish B1 from B2: least square of the sine of the angle between them.
constexpr double least_determinant = 1e-6;

void observe_lanes(std::size_t lanes, const readout::LaneReadings& readings, TwoTrain::State& state,
                   LaneErrors& errors) {
    const D d;
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    const V tiny = hn::Set(d, 1e-300);
    const V half_root_pi_fringes = hn::Set(d, 0.14104739588693907);  // sqrt(pi)/2/(2 pi)
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const V decay = load(state.decay);
        const V forgetting = load(state.forgetting);
        const V settle = load(state.settle);
        const V learn = load(state.learn);
        Average average[4];
        for (std::size_t k = 0; k < 4; ++k) average[k] = {load(state.mean_rad_s2[k]), load(state.count[k])};
        V after_last[2], pending[2], b[2];
        for (std::size_t k = 0; k < 2; ++k) {
            after_last[k] = load(state.after_last[k]);
            pending[k] = load(state.pending[k]);
            b[k] = load(state.b_rad_s[k]);
        }
        V once[3], twice[3];
        for (std::size_t k = 0; k < 3; ++k) {
            once[k] = load(state.once[k]);
            twice[k] = load(state.twice[k]);
        }
        V last_fringes = load(state.last_fringes);
        V last_whole = load(state.last_whole);
        V c11 = load(state.c11);
        V c12 = load(state.c12);
        V c22 = load(state.c22);
        V c1y = load(state.c1y);
        V c2y = load(state.c2y);
        V error = load(state.error_fringes);
        V error_whole = load(state.error_whole);
        const V whole_before = error_whole;
        store(whole_before, errors.whole);
        for (std::size_t i = 0; i < readings.turns; ++i) {
            const std::int64_t turn = readings.first_turn + static_cast<std::int64_t>(i);
            const bool minimum = readings.minimum(i);
            const V sine = load(readings.sine[i]);
            const V cosine = load(readings.cosine[i]);
            const V size2 = hn::Max(sm::fma(d, sine, sine, cosine * cosine), tiny);
            const V sum = half_root_pi_fringes * (sine + cosine);
            const V difference = half_root_pi_fringes * (minimum ? cosine - sine : sine - cosine);
            Average* const sides = average + (minimum ? 0 : 2);
            const auto inverse_root = [&](Average& of, V acceleration) HWY_ATTR {
                const V a = of.update(d, acceleration);
                return hn::IfThenElseZero(a > zero, one / hn::Sqrt(hn::Max(a, tiny) * size2));
            };
            const V before_scale = inverse_root(sides[0], load(readings.accel_before_rad_s2[i]));
            const V after_scale = inverse_root(sides[1], load(readings.accel_after_rad_s2[i]));
            const V unit[2] = {minimum ? sum : difference, minimum ? difference : sum};
            if (errors.middles) {
                const V middle = sm::fma(d, b[0], after_last[0], sm::fma(d, b[1], after_last[1], error));
                store(middle + (error_whole - whole_before), errors.middle_fringes[i]);
            }
            V gained[2];
            for (std::size_t k = 0; k < 2; ++k) {
                gained[k] = sm::fma(d, unit[k], before_scale, after_last[k]);
                after_last[k] = unit[k] * after_scale;
                pending[k] = pending[k] + gained[k];
            }
            error = sm::fma(d, b[0], gained[0], sm::fma(d, b[1], gained[1], error));
            // Whole fringes are put apart at every turn: bits must not depend on where a piece ends.
            const V carry = sm::nearest(d, error);
            error = error - carry;
            error_whole = error_whole + carry;
            store(error + (error_whole - whole_before), errors.fringes[i]);

            if (minimum) {
                const V fringes = load(readings.phase_fringes[i]);
                const V whole = load(readings.phase_whole[i]);
                if (turn > 0) {
                    const V gains[3] = {(whole - last_whole) + (fringes - last_fringes), pending[0], pending[1]};
                    for (std::size_t k = 0; k < 3; ++k) {
                        const V passed = decay * (once[k] + gains[k]);
                        twice[k] = decay * (twice[k] + (passed - once[k]));
                        once[k] = passed;
                    }
                    const auto settled = hn::Set(d, static_cast<double>(turn / 2)) > settle;
                    const auto faded = [&](V& total, V x, V y) HWY_ATTR {
                        total = sm::fma(d, total, forgetting, hn::IfThenElseZero(settled, x * y));
                    };
                    faded(c11, twice[1], twice[1]);
                    faded(c12, twice[1], twice[2]);
                    faded(c22, twice[2], twice[2]);
                    faded(c1y, twice[1], twice[0]);
                    faded(c2y, twice[2], twice[0]);
                }
                pending[0] = pending[1] = zero;
                last_fringes = fringes;
                last_whole = whole;
            }
            if (turn % turns_between_solutions == 0) {
                const V determinant = sm::fnma(d, c12, c12, c11 * c22);
                const auto solvable = hn::And(hn::Set(d, static_cast<double>(turn / 2)) > learn,
                                              determinant > hn::Set(d, least_determinant) * c11 * c22);
                const V inverse = one / hn::IfThenElse(solvable, determinant, one);
                b[0] = hn::IfThenElse(solvable, sm::fnma(d, c12, c2y, c22 * c1y) * inverse, b[0]);
                b[1] = hn::IfThenElse(solvable, sm::fnma(d, c12, c1y, c11 * c2y) * inverse, b[1]);
            }
        }
        for (std::size_t k = 0; k < 4; ++k) {
            store(average[k].mean, state.mean_rad_s2[k]);
            store(average[k].count, state.count[k]);
        }
        for (std::size_t k = 0; k < 2; ++k) {
            store(after_last[k], state.after_last[k]);
            store(pending[k], state.pending[k]);
            store(b[k], state.b_rad_s[k]);
        }
        for (std::size_t k = 0; k < 3; ++k) {
            store(once[k], state.once[k]);
            store(twice[k], state.twice[k]);
        }
        store(last_fringes, state.last_fringes);
        store(last_whole, state.last_whole);
        store(c11, state.c11);
        store(c12, state.c12);
        store(c22, state.c22);
        store(c1y, state.c1y);
        store(c2y, state.c2y);
        store(error, state.error_fringes);
        store(error_whole, state.error_whole);
    }
}

}  // namespace ringlock::compensate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::compensate {

HWY_EXPORT(observe_lanes);

TwoTrain::TwoTrain(const Calibration& calibration) : lanes_(calibration.lanes) {
    constexpr double high_pass_s = 0.5;
    constexpr double memory_s = 1000.0;
    // exp(-16) is left of the step with which the ramp sets in, some 1e-3 fringes at thousands of deg/h.
    constexpr double settle_s = 16.0 * high_pass_s;
    constexpr double learn_s = 8.0;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const std::size_t which = std::min(lane, calibration.lanes - 1);
        const double period_s = calibration.positive_duration_s[which] + calibration.negative_duration_s[which];
        state_.decay[lane] = high_pass_s / (high_pass_s + period_s);
        state_.forgetting[lane] = 1.0 - period_s / memory_s;
        state_.settle[lane] = settle_s / period_s;
        state_.learn[lane] = (settle_s + learn_s) / period_s;
    }
}

void TwoTrain::observe(const readout::LaneReadings& readings, LaneErrors& errors) {
    errors.resize(readings.turns);
    HWY_DYNAMIC_DISPATCH(observe_lanes)(lanes_, readings, state_, errors);
}

}  // namespace ringlock::compensate
#endif
