#include "engine/readout/fraction_recovery.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/readout/fraction_recovery.cpp"
#include "engine/core/units.hpp"
#include "engine/readout/pulse_readout.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/gyro/turn_series-inl.hpp"
#include "engine/readout/pulse_tables-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::readout::HWY_NAMESPACE {

namespace gm = gyro::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

constexpr double model_rad = 1e-6;        // allowance for errors of parabola, tables and coupling
constexpr double largest_step_rad = 0.2;  // beyond it pulses and detectors contradict each other
constexpr double memory_cycles = 512.0;

/// Products of a column of the pulses' equations with the others, weighted sums.
template <class V>
struct Column {
    V one, slope, first, second, y, after;
};

/// Rows [first_row, last_row) of the readings. `angles` may be absent.
template <bool learning>
void recover_all(std::size_t lanes, const FractionRecovery::Known& known, const PulseTables& tables,
                 const Electronics& electronics, FractionRecovery::State& state, LaneReadings& readings,
                 std::size_t first_row, std::size_t last_row, LaneAngles* angles) {
    const D d;
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    const V half = hn::Set(d, 0.5);
    const V two_pi = hn::Set(d, 6.283185307179586);
    const V per_rad = hn::Set(d, 0.15915494309189535);
    const V quarter_rad = hn::Set(d, 1.5707963267948966);
    const auto squared = [](double value) { return value * value; };
    const double step =
        electronics.adc_bits > 0 ? 2.0 * Electronics::adc_range * std::ldexp(1.0, -electronics.adc_bits) : 0.0;
    const V sample_weight =
        hn::Set(d, 1.0 / (squared(electronics.detector_noise_relative) + squared(step) / 12.0 + squared(model_rad)));
    const V pulse_variance = hn::Set(d, squared(electronics.comparator_noise_relative) + squared(model_rad));
    const V tick_variance = hn::Set(d, electronics.clock_hz > 0.0 ? 1.0 / (12.0 * squared(electronics.clock_hz)) : 0.0);
    const V hysteresis = hn::Set(d, electronics.comparator_hysteresis_relative);
    const V least = hn::Set(d, least_distance_rad(electronics));
    const V least_of_mean = hn::Max(least, hn::Set(d, 1e-3));
    const double low_pass = low_pass_s(electronics);
    const V blunting = hn::Set(d, 0.5 * low_pass * low_pass);
    const bool growing = known.change_rms_rad > 0.0;
    const V per_three_pi = hn::Set(d, 0.1061032953945969);
    const bool shifted = !readings.pulses.known_shift_rad[0].empty();
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const V mean_amplitude = load(known.amplitude_rad);
        const V b = load(known.b_rad_s);
        // Half cycles share a turn's noise: half of the one before's deviation is in the one after, 3/4 of the variance
        // new.
        const V amplitude_relative = load(known.amplitude_relative);
        const V share_variance = growing ? hn::Set(d, squared(known.change_rms_rad))
                                         : amplitude_relative * amplitude_relative * hn::Set(d, 0.75);
        V last_amplitude = load(state.turn_amplitude_rad);
        V last_fringes = load(state.last_fringes);
        V last_whole = load(state.last_whole);
        V last_gain = load(state.last_gain);
        V last_pull_rad_s = load(state.last_pull_rad_s);
        V cycle_gain = load(state.cycle_gain);
        V cycles = load(state.cycles);
        V contradictions = load(state.contradictions);
        V normal[5] = {load(state.xx), load(state.xy), load(state.yy), load(state.x), load(state.y)};
        for (std::size_t i = first_row; i < last_row; ++i) {
            const bool minimum = readings.minimum(i);
            const V sign = hn::Set(d, minimum ? 1.0 : -1.0);
            const std::size_t direction = minimum ? 0 : 1;
            const std::size_t after_side = minimum ? 0 : 1;
            const std::int64_t before_turns = state.turns + static_cast<std::int64_t>(i - first_row);
            const V read = load(readings.phase_fringes[i]);
            const V raw_sine = load(readings.sine[i]);
            const V raw_cosine = load(readings.cosine[i]);
            const V size =
                one / hn::Sqrt(hn::Max(sm::fma(d, raw_sine, raw_sine, raw_cosine * raw_cosine), hn::Set(d, 1e-300)));
            const V b_cosine = load(known.coupling_cosine_rad_s);
            const V b_sine = load(known.coupling_sine_rad_s);
            const V lockin_rad_s = sm::fma(d, raw_sine, b_cosine, raw_cosine * b_sine) * size;
            const V pull_rad_s =
                sm::fma(d, sign, lockin_rad_s, sm::fnma(d, raw_sine, b_sine, raw_cosine * b_cosine) * size);
            // The swing shows the amplitude of the half cycle that ends here, but for the input rate's share and the
            // lock-in's, to first order (b/2) sqrt(pi/a) (sin x + cos x) at the turn where it begins less that at its
            // end.
            V deviation = zero;
            if (before_turns > 0) {
                const V gain = (load(readings.phase_whole[i]) - last_whole) + (read - last_fringes);
                const V share = cycle_gain * load(known.half_share[1 - after_side]);
                const V locked_rad = (last_pull_rad_s - pull_rad_s) * half * load(known.root_pi_over_a_s[direction]);
                deviation = sm::fma(d, half * two_pi, hn::Neg(sign) * (gain - share),
                                    sm::fnma(d, half, locked_rad, hn::Neg(mean_amplitude)));
            }
            V amplitude[2] = {mean_amplitude + deviation, sm::fma(d, half, deviation, mean_amplitude)};
            V change_before = zero;
            if (growing && before_turns > 0) {
                const auto after = gm::amplitude_after_swing(d, amplitude[0], last_amplitude, sign, before_turns);
                change_before = after.amplitude - last_amplitude;
                last_amplitude = after.amplitude;
                cycle_gain = sm::fnma(d, after.rotation_less, per_rad + per_rad, cycle_gain);
            }
            if (growing) amplitude[0] = amplitude[1] = last_amplitude;
            const V accel[2] = {amplitude[0] * load(known.w2_per_amplitude[direction][0]),
                                amplitude[1] * load(known.w2_per_amplitude[direction][1])};
            // From the dither's turn, where the sides meet, to the vertex of the side before; and that of the other one
            // less that.
            const V standing_rad_s = sign * sm::fma(d, cycle_gain, load(known.rad_s_per_cycle_gain), lockin_rad_s);
            const V vertex_s = hn::Neg(standing_rad_s / accel[0]);
            const V vertices_s = vertex_s * (accel[0] / accel[1] - one);
            // e after less e before is (a' - a) s^2/2, s the time from the sample to the dither's turn: about that of a
            // sample at the vertex of the half cycle in which it lies.
            const auto late = vertex_s > zero;
            const V steeper = accel[1] - accel[0];
            const V tau_there = hn::IfThenElseZero(late, hn::Neg(vertices_s));
            const V turn_s_there = tau_there - vertex_s;
            const V slope_of_deeper = steeper * turn_s_there;
            const V deeper = slope_of_deeper * sm::fnma(d, half, vertex_s, hn::Neg(half * tau_there));

            const V first = load(readings.pulses.first_quarter[i]);
            const V near = (first - sign * read * hn::Set(d, 4.0)) * quarter_rad;
            const V inside = hn::Max(hn::Min(near, quarter_rad), zero);
            const V x = sm::fma(d, hn::Sqrt(inside + inside), hn::Set(d, 1.1283791670955126), hn::Neg(one));
            const auto quarter = quarter_of(d, first - one);
            const auto factors = pulse_factors<kept_pulses>(d, tables.times[direction], tables.used, lane, quarter, x);
            PulseFactors<V, kept_pulses> turned;  // of a coupling a quarter fringe on
            if constexpr (learning) {
                turned = pulse_factors<kept_pulses>(d, tables.times[direction], tables.used, lane,
                                                    quarter_of(d, minimum ? first : first - one - one), x);
            }
            V shift[kept_pulses] = {zero, zero, zero, zero};
            for (std::size_t pulse = 0; pulse < kept_pulses && shifted; ++pulse) {
                const auto number = quarter_of(d, sign * (first + hn::Set(d, static_cast<double>(pulse))));
                const auto& known_shift = readings.pulses.known_shift_rad;
                const V low = hn::IfThenElse(number.odd, load(known_shift[1][i]), load(known_shift[0][i]));
                const V high = hn::IfThenElse(number.odd, load(known_shift[3][i]), load(known_shift[2][i]));
                shift[pulse] = hn::IfThenElse(number.upper, high, low);
            }
            V s0 = sample_weight;
            V s1 = zero;
            V s2 = zero;
            V sy = zero;
            V sgy = zero;
            V share_one = zero;  // of the column of psi'' after the turn
            V share_slope = zero;
            V share_share = zero;
            V share_y = zero;
            Column<V> bends[2] = {{zero, zero, zero, zero, zero, zero}, {zero, zero, zero, zero, zero, zero}};
            for (std::size_t side = 0; side < 2; ++side) {
                const V a = accel[side];
                const std::size_t half_sign = side == 0 ? 1 - after_side : after_side;
                const V bend = b / hn::Sqrt(a) * load(tables.inverse_bend[half_sign]);
                const V curve = load(known.w2[half_sign]) / a;
                for (std::size_t pulse = 0; pulse < kept_pulses; ++pulse) {
                    const V time = load(readings.pulses.time_s[side][pulse][i]);
                    const V nominal = sm::fma(d, hn::Set(d, static_cast<double>(pulse)), quarter_rad, near);
                    V distance = side == 0 ? nominal - hysteresis : nominal + hysteresis;
                    if (shifted) distance = sm::fma(d, sign, shift[pulse], distance);
                    const V straight = sinusoid_factor(d, curve * nominal);
                    const V bent = bend * factors.values[side][pulse];
                    const V factor = straight + bent;
                    V slope = a * time / (factor * factor);
                    V y = sm::fma(d, half * slope, time, hn::Neg(distance));
                    if (side == 1) {
                        y = sm::fnma(d, slope, vertices_s, y + deeper);
                        slope = slope - slope_of_deeper;
                    }
                    const V variance = sm::fma(d, (distance + distance) * a, tick_variance, pulse_variance);
                    V weight = one / variance;
                    V swelling = zero;  // of the distance, for a change of 1 rad over the half cycle
                    if (growing) {
                        const V angle2 = load(known.w2[half_sign]) * time * time;
                        swelling = per_three_pi * angle2 * hn::Sqrt(angle2);
                        if (side == 0) y = sm::fnma(d, change_before, swelling, y);
                    }
                    // The square of a noisy time is larger in the mean, by the time's variance: v/(4 D) in phase.
                    y = sm::fnma(d, variance, hn::Set(d, 0.25) / hn::Max(distance, least_of_mean), y);
                    if (pulse == 0) {
                        weight = hn::IfThenElseZero(hn::And(time != zero, distance > least), weight);
                    }
                    const V weighted = weight * slope;
                    s0 = s0 + weight;
                    s1 = s1 + weighted;
                    s2 = sm::fma(d, weighted, slope, s2);
                    sy = sm::fma(d, weight, y, sy);
                    sgy = sm::fma(d, weighted, y, sgy);
                    const V of_share = growing ? swelling : sm::fma(d, slope, vertex_s, distance);
                    if (side == 1) {
                        const V heavy = weight * of_share;
                        share_one = share_one + heavy;
                        share_slope = sm::fma(d, heavy, slope, share_slope);
                        share_share = sm::fma(d, heavy, of_share, share_share);
                        share_y = sm::fma(d, heavy, y, share_y);
                    }
                    if constexpr (learning) {
                        const V scale = (distance + distance) / factor;
                        const V p[2] = {scale * bent, scale * bend * turned.values[side][pulse]};
                        for (std::size_t k = 0; k < 2; ++k) {
                            const V heavy = weight * p[k];
                            bends[k].one = bends[k].one + heavy;
                            bends[k].slope = sm::fma(d, heavy, slope, bends[k].slope);
                            bends[k].first = sm::fma(d, heavy, p[0], bends[k].first);
                            bends[k].second = sm::fma(d, heavy, p[1], bends[k].second);
                            bends[k].y = sm::fma(d, heavy, y, bends[k].y);
                            if (side == 1) bends[k].after = sm::fma(d, heavy, of_share, bends[k].after);
                        }
                    }
                }
            }
            // All products less the part that the share of psi'' explains (Sherman and Morrison 1950).
            const V explained = share_variance / sm::fma(d, share_variance, share_share, one);
            const auto without = [&](V& product, V u, V v)
                                     HWY_ATTR { product = sm::fnma(d, explained * u, v, product); };
            without(s0, share_one, share_one);
            without(s1, share_one, share_slope);
            without(s2, share_slope, share_slope);
            without(sy, share_one, share_y);
            without(sgy, share_slope, share_y);
            if constexpr (learning) {
                for (Column<V>& column : bends) {
                    without(column.one, column.after, share_one);
                    without(column.slope, column.after, share_slope);
                    without(column.first, column.after, bends[0].after);
                    without(column.second, column.after, bends[1].after);
                    without(column.y, column.after, share_y);
                }
            }
            const V inverse = one / s2;
            const V e = sm::fma(d, s1 * inverse, sgy, hn::Neg(sy)) / sm::fnma(d, s1 * inverse, s1, s0);
            const V tau = sm::fma(d, e, s1, sgy) * inverse;
            const V a_mean = mean_amplitude * hn::IfThenElse(late, load(known.w2_per_amplitude[direction][1]),
                                                             load(known.w2_per_amplitude[direction][0]));
            const V turned_s = hn::IfThenElse(late, tau + vertices_s, tau);
            const V sampled_s = tau - vertex_s;  // from the sample to the dither's turn
            V change = sm::fnma(d, a_mean, sm::fma(d, half * turned_s, turned_s, blunting),
                                e + hn::IfThenElseZero(late, half * steeper * sampled_s * sampled_s));
            const auto agree = hn::Abs(change) < hn::Set(d, largest_step_rad);
            change = sign * hn::IfThenElseZero(agree, change);
            // No swing has determined the amplitude yet.
            if (growing && before_turns == 0) change = zero;
            contradictions = contradictions + hn::IfThenElse(agree, zero, one);

            if constexpr (learning) {
                // The part of the bends that the three unknowns do not explain.
                const V determinant = one / sm::fnma(d, s1, s1, s0 * s2);
                const auto apart = [&](const Column<V>& column, V product, V with_one, V with_slope) HWY_ATTR {
                    const V of_one = sm::fnma(d, s1, with_slope, s2 * with_one) * determinant;
                    const V of_slope = sm::fnma(d, s1, with_one, s0 * with_slope) * determinant;
                    return product - sm::fma(d, column.one, of_one, column.slope * of_slope);
                };
                const V turn[5] = {apart(bends[0], bends[0].first, bends[0].one, bends[0].slope),
                                   apart(bends[0], bends[0].second, bends[1].one, bends[1].slope),
                                   apart(bends[1], bends[1].second, bends[1].one, bends[1].slope),
                                   apart(bends[0], bends[0].y, sy, sgy), apart(bends[1], bends[1].y, sy, sgy)};
                for (std::size_t k = 0; k < 5; ++k) {
                    normal[k] = normal[k] + hn::IfThenElseZero(agree, turn[k]);
                }
            }

            V turn_s, turn_c;
            gm::sincos_small(d, change, turn_s, turn_c);
            store(size * sm::fma(d, raw_sine, turn_c, raw_cosine * turn_s), readings.sine[i]);
            store(size * sm::fnma(d, raw_sine, turn_s, raw_cosine * turn_c), readings.cosine[i]);
            const V change_fringes = change * per_rad;
            const V fringes = read + change_fringes;
            store(fringes, readings.phase_fringes[i]);
            if (angles != nullptr && electronics.interpolate) {
                store(load(angles->angle_fringes[i]) + change_fringes, angles->angle_fringes[i]);
            }

            const V whole = load(readings.phase_whole[i]);
            if (before_turns > 0) {
                const V gain = (whole - last_whole) + (fringes - last_fringes);
                if (before_turns > 1 && !growing) {
                    cycles = hn::Min(cycles + one, hn::Set(d, memory_cycles));
                    cycle_gain = cycle_gain + (gain + last_gain - cycle_gain) / cycles;
                }
                last_gain = gain;
            }
            last_pull_rad_s = pull_rad_s;
            last_fringes = fringes;
            last_whole = whole;
        }
        store(last_fringes, state.last_fringes);
        store(last_whole, state.last_whole);
        store(last_gain, state.last_gain);
        store(last_amplitude, state.turn_amplitude_rad);
        store(last_pull_rad_s, state.last_pull_rad_s);
        store(cycle_gain, state.cycle_gain);
        store(cycles, state.cycles);
        store(contradictions, state.contradictions);
        if constexpr (learning) {
            simd::Lanes* const to[5] = {&state.xx, &state.xy, &state.yy, &state.x, &state.y};
            for (std::size_t k = 0; k < 5; ++k) store(normal[k], *to[k]);
        }
    }
}

void recover_lanes(std::size_t lanes, const FractionRecovery::Known& known, const PulseTables& tables,
                   const Electronics& electronics, bool learning, FractionRecovery::State& state,
                   LaneReadings& readings, std::size_t first_row, std::size_t last_row, LaneAngles* angles) {
    const auto recover = learning ? recover_all<true> : recover_all<false>;
    recover(lanes, known, tables, electronics, state, readings, first_row, last_row, angles);
}

}  // namespace ringlock::readout::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::readout {

HWY_EXPORT(recover_lanes);

FractionRecovery::FractionRecovery(std::span<const gyro::Device> devices, const Electronics& electronics,
                                   double amplitude_rms_rad, double change_rms_rad)
    : lanes_(devices.size()), electronics_(electronics) {
    known_.change_rms_rad = change_rms_rad;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const gyro::Device& device = devices_.emplace_back(devices[std::min(lane, devices.size() - 1)]);
        const double amplitude = device.dither_amplitude_rad;
        known_.amplitude_rad[lane] = state_.turn_amplitude_rad[lane] = amplitude;
        known_.half_share[0][lane] = device.positive_duration_s / device.period_s();
        known_.half_share[1][lane] = device.negative_duration_s / device.period_s();
        known_.amplitude_relative[lane] = amplitude_rms_rad / amplitude;
        known_.rad_s_per_cycle_gain[lane] = units::two_pi / device.period_s();
        for (const std::size_t which : {0U, 1U}) {
            const double duration = which == 0 ? device.positive_duration_s : device.negative_duration_s;
            known_.w2[which][lane] = (units::pi / duration) * (units::pi / duration);
            for (const std::size_t side : {0U, 1U}) {
                const double half_sign = (which == 0) == (side == 1) ? 1.0 : -1.0;
                const gyro::HalfCycle half = device.half_cycle(half_sign, amplitude);
                const double acceleration = half.end_acceleration_rad_s2(side == 0 ? 1 : 0);
                known_.w2_per_amplitude[which][side][lane] = acceleration / amplitude;
                if (side == 0) known_.root_pi_over_a_s[which][lane] = std::sqrt(units::pi / acceleration);
            }
        }
        make_tables(lane);
    }
}

void FractionRecovery::make_tables(std::size_t lane) {
    const gyro::Coupling& coupling = devices_[lane].coupling;
    known_.b_rad_s[lane] = coupling.b_rad_s;
    known_.coupling_cosine_rad_s[lane] = coupling.b_rad_s * std::cos(coupling.phase_rad);
    known_.coupling_sine_rad_s[lane] = coupling.b_rad_s * std::sin(coupling.phase_rad);
    tables_.make(lane, devices_[lane], kept_pulses);
}

void FractionRecovery::recover(LaneReadings& readings, LaneAngles* angles) {
    recover(readings, 0, readings.turns, angles);
}

void FractionRecovery::recover(LaneReadings& readings, std::size_t first_row, std::size_t last_row,
                               LaneAngles* angles) {
    HWY_DYNAMIC_DISPATCH(recover_lanes)
    (lanes_, known_, tables_, electronics_, learning_, state_, readings, first_row, last_row, angles);
    state_.turns += static_cast<std::int64_t>(last_row - first_row);
}

void FractionRecovery::set_coupling(std::size_t lane, const Coupling& coupling) {
    devices_[lane].coupling.b_rad_s = coupling.b_rad_s;
    devices_[lane].coupling.phase_rad = coupling.phase_rad;
    make_tables(lane);
    forget_bends(lane);
}

void FractionRecovery::forget_bends(std::size_t lane) {
    for (auto* const sum : {&state_.xx, &state_.xy, &state_.yy, &state_.x, &state_.y}) (*sum)[lane] = 0.0;
}

}  // namespace ringlock::readout
#endif
