#include "engine/compensate/exact.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/compensate/exact.cpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/gyro/turn_series-inl.hpp"
#include "engine/propagate/turn_tables-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::compensate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;
namespace gm = gyro::HWY_NAMESPACE;
namespace pm = propagate::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

constexpr int most_steps = 20000;

/// Gain of the phase from the zero-rate point, where its sine and cosine are given, to the dither's turn, and the
/// lock-in's share of that gain. `sine` and `cosine` become those at the dither's turn. False where it is too far.
HWY_INLINE bool walk_to_dither_turn(D d, const gm::UprightSide<V>& side, V inverse_angle, V& sine, V& cosine,
                                    V& phase_rad, V& lockin_rad) {
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    const gm::UprightExtras<V> none{zero, zero, zero, zero, zero, zero, zero};
    // rate + A w sin(w t) + b sin x = 0
    const V y = hn::Neg(sm::fma(d, side.b, sine, side.rate)) / (side.amplitude * side.w);
    static constexpr double of_asin[] = {1.0 / 6, 3.0 / 40, 15.0 / 336, 105.0 / 3456, 945.0 / 42240, 10395.0 / 599040};
    const V y2 = y * y;
    V angle = sm::fma(d, y * y2, sm::polynomial(d, y2, of_asin), y);
    V left = hn::Neg(angle * inverse_angle);  // to go, in scales of time
    V sine_wt = y;
    V cosine_wt = hn::Sqrt(hn::Max(sm::fnma(d, y, y, one), zero));
    phase_rad = zero;
    lockin_rad = zero;
    gm::TurnSeries<D, false> series;
    for (int step = 0; step < most_steps; ++step) {
        series.expand(d, side, none, sine_wt, cosine_wt, sine, cosine);
        V h = left;
        if (!hn::AllTrue(d, gm::within_step(d, hn::Abs(left), series.rate[1]))) {
            h = hn::CopySign(hn::Min(hn::Abs(left), gm::longest_step(d, series.rate[1])), left);
        }
        V phase, lockin;
        series.gains(d, h, phase, lockin);
        phase_rad = phase_rad + phase;
        lockin_rad = lockin_rad + lockin;
        V turn_s, turn_c;
        gm::sincos_small(d, phase, turn_s, turn_c);
        const V turned = sm::fnma(d, sine, turn_s, cosine * turn_c);
        sine = sm::fma(d, cosine, turn_s, sine * turn_c);
        cosine = turned;
        left = left - h;
        if (hn::AllTrue(d, left == zero)) return true;
        angle = sm::fma(d, h, side.angle, angle);
        sm::sincos(d, angle * hn::Set(d, 0.15915494309189535), sine_wt, cosine_wt);
    }
    return false;
}

/// The estimate of the rate or the coupling has changed: the path from the last reading to the dither's turn is
/// computed anew, so that the error returned there makes no step.
bool place_last_turn(D d, bool minimum, std::size_t lane, Exact::State& state) {
    const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
    const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
    const V sign = hn::Set(d, minimum ? 1.0 : -1.0);
    const V per_rad = hn::Set(d, 0.15915494309189535);
    const V scale_angle = load(state.scale_angle);
    const V phase_sine = load(state.coupling_sine);
    const V phase_cosine = load(state.coupling_cosine);
    V sine = sign * sm::fma(d, load(state.read_cosine), phase_sine, load(state.read_sine) * phase_cosine);
    V cosine = sm::fnma(d, load(state.read_sine), phase_sine, load(state.read_cosine) * phase_cosine);
    const gm::UprightSide<V> side{load(state.read_amplitude_rad), load(state.read_angular_frequency_rad_s),
                                  sign * load(state.rate_rad_s),  load(state.b_rad_s),
                                  load(state.read_scale_s),       scale_angle};
    V phase_rad, lockin_rad;
    if (!walk_to_dither_turn(d, side, hn::Set(d, 1.0) / scale_angle, sine, cosine, phase_rad, lockin_rad)) {
        return false;
    }
    store(sine, state.sine);
    store(cosine, state.cosine);
    store(sm::fma(d, sign * phase_rad, per_rad, load(state.read_fringes)), state.turn_fringes);
    store(sm::fma(d, sign * (lockin_rad - load(state.read_lockin_rad)), per_rad, load(state.error_fringes)),
          state.error_fringes);
    store(lockin_rad, state.read_lockin_rad);
    return true;
}

/// Rows [first_row, last_row) of the readings; errors are given less errors.whole. `changed`: rate or coupling are
/// others than at the row before. `first_turn`: number of turns seen before the first row.
bool observe_lanes(std::size_t lanes, const propagate::TurnTables& tables, const Exact::Parts& parts,
                   const readout::LaneReadings& readings, std::size_t first_row, std::size_t last_row, bool begun,
                   bool changed, std::int64_t first_turn, Exact::State& state, LaneErrors& errors) {
    const D d;
    const auto turns_before = [&](std::size_t row) { return first_turn + static_cast<std::int64_t>(row - first_row); };
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    const V half = hn::Set(d, 0.5);
    const V per_rad = hn::Set(d, 0.15915494309189535);
    const V two_pi = hn::Set(d, 6.283185307179586);
    const bool strong = tables.strong();
    const bool changing = tables.changing();
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        if (begun && changed && !place_last_turn(d, !readings.minimum(first_row), lane, state)) return false;
        const V phase_sine = load(state.coupling_sine);
        const V phase_cosine = load(state.coupling_cosine);
        const V mean_amplitude = load(state.amplitude_rad);
        const V b = load(state.b_rad_s);
        const V scale_angle = load(state.scale_angle);
        const V inverse_angle = one / scale_angle;
        const V rate = load(state.rate_rad_s);
        const V centre = load(tables.centre()[0]);
        const V inverse = load(tables.inverse_half_width()[0]);
        const V change_inverse = load(tables.inverse_half_width()[3]);
        V last_amplitude = load(state.turn_amplitude_rad);
        V middles_rate = load(state.middles_rate_rad_s);
        V last_sine = load(state.sine);
        V last_cosine = load(state.cosine);
        V last_fringes = load(state.turn_fringes);
        V last_whole = load(state.turn_whole);
        V error = load(state.error_fringes);
        V error_whole = load(state.error_whole);
        const V whole_before = load(errors.whole);
        for (std::size_t i = first_row; i < last_row; ++i) {
            const bool minimum = readings.minimum(i);
            const V sign = hn::Set(d, minimum ? 1.0 : -1.0);
            const V raw_sine = load(readings.sine[i]);
            const V raw_cosine = load(readings.cosine[i]);
            const V size =
                one / hn::Sqrt(hn::Max(sm::fma(d, raw_sine, raw_sine, raw_cosine * raw_cosine), hn::Set(d, 1e-300)));
            const V read_sine = raw_sine * size;
            const V read_cosine = raw_cosine * size;
            V sine = sign * sm::fma(d, read_cosine, phase_sine, read_sine * phase_cosine);
            V cosine = sm::fnma(d, read_sine, phase_sine, read_cosine * phase_cosine);
            const std::size_t after = minimum ? 0 : 1;
            const V w_after = load(state.angular_frequency_rad_s[after]);
            const V w_before = load(state.angular_frequency_rad_s[1 - after]);

            // The half cycle that ends here, turned upright by its own sign, which is that of the turn before.
            const V swing = hn::Neg(sign) * ((load(readings.phase_whole[i]) - last_whole) +
                                             (load(readings.phase_fringes[i]) - last_fringes));
            const V duration = load(state.duration_s[1 - after]);
            const V plain_rotation = hn::Neg(sign) * (changing ? middles_rate : rate) * duration;
            // First from zero-rate point to dither's turn by the amplitude that the swing shows but for the lock-in.
            const V rough = half * sm::fma(d, swing, two_pi, hn::Neg(plain_rotation));
            const bool has_before = begun || i > 0;
            V before_amplitude = has_before ? rough : mean_amplitude;
            V after_amplitude = mean_amplitude;
            if (changing && has_before) {
                before_amplitude = after_amplitude =
                    gm::amplitude_after_swing(d, rough, last_amplitude, sign, turns_before(i)).amplitude;
            }
            const V standstill = sm::fma(d, b, sine, sign * rate);
            const auto ahead = standstill < zero;
            const gm::UprightSide<V> side{
                hn::IfThenElse(ahead, after_amplitude, before_amplitude),
                hn::IfThenElse(ahead, w_after, w_before),
                sign * rate,
                b,
                hn::IfThenElse(ahead, load(state.scale_s[after]), load(state.scale_s[1 - after])),
                scale_angle};
            V phase_rad, lockin_rad;
            if (!walk_to_dither_turn(d, side, inverse_angle, sine, cosine, phase_rad, lockin_rad)) return false;
            const V turn_fringes = sm::fma(d, sign * phase_rad, per_rad, load(readings.phase_fringes[i]));
            if (errors.middles && !has_before) store(error, errors.middle_fringes[i]);
            if (has_before) {
                const auto scaled = [&](V amplitude) HWY_ATTR {
                    return hn::Max(hn::Min((amplitude - centre) * inverse, one), hn::Neg(one));
                };
                const propagate::TurnTables::Part& part = parts[minimum ? 0 : 1];
                // To first order for the amplitude, then in full: exp(-i x_0) and exp(-i x_1).
                const V moved =
                    sm::fma(d, hn::Neg(sign) * (turn_fringes - load(readings.phase_fringes[i])), one, swing);
                const pm::HalfMapOf<V> first = pm::middle(d, part, lane);
                const V bend = sm::fma(d, first.z_im, last_cosine - cosine,
                                       hn::Neg(first.z_re * (last_sine - sine)));  // Im z (e_0 - e_1)
                const V gain_rad = sm::fma(d, bend, hn::Set(d, 2.0), first.shift * (two_pi + two_pi));
                const V amplitude = half * (sm::fma(d, moved, two_pi, hn::Neg(plain_rotation)) - gain_rad);
                pm::HalfMapOf<V> begin, end;
                if (changing) {
                    // Amplitude and change as seen from either turn.
                    const auto swung = gm::amplitude_after_swing(d, amplitude, last_amplitude, sign, turns_before(i));
                    const V change = swung.amplitude - last_amplitude;
                    const V half_change = change * half;
                    const V scaled_change = hn::Max(hn::Min(change * change_inverse, one), hn::Neg(one));
                    begin = pm::evaluate(d, part, lane, scaled(amplitude - half_change), zero, zero, scaled_change);
                    end = pm::evaluate(d, part, lane, scaled(amplitude + half_change), zero, zero,
                                       hn::Neg(scaled_change));
                    last_amplitude = swung.amplitude;
                    middles_rate = middles_rate - swung.rotation_less / duration;
                } else {
                    begin = end = pm::evaluate(d, part, lane, scaled(amplitude), zero, zero, zero);
                }
                const sm::Complex<V> z_begin{begin.z_re, begin.z_im};
                const sm::Complex<V> z_end{end.z_re, end.z_im};
                const sm::Complex<V> unit{one, zero};
                const sm::Complex<V> e0{last_cosine, hn::Neg(last_sine)};
                const sm::Complex<V> e1{hn::Neg(cosine), sine};
                const sm::Complex<V> beginning = sm::mul_add(d, z_begin, e0, unit);
                const sm::Complex<V> q = sm::mul(d, beginning, sm::mul_add(d, z_end, e1, unit));
                if (errors.middles) {
                    const V bent = sm::arg(d, beginning.re, beginning.im) * hn::Set(d, 0.3183098861837907);
                    store(sm::fnma(d, sign, bent + begin.shift, error) + (error_whole - whole_before),
                          errors.middle_fringes[i]);
                }
                const V gain = sm::fma(d, strong ? sm::arg(d, q.re, q.im) : sm::arg_right(d, q.re, q.im),
                                       hn::Set(d, 0.3183098861837907), begin.shift + end.shift);
                // Whole fringes are put apart at every turn: bits must not depend on where a piece ends.
                error = sm::fnma(d, sign, gain, error);
                const V carry = sm::nearest(d, error);
                error = error - carry;
                error_whole = error_whole + carry;
            }
            // From the dither's turn to the zero-rate point again: the lock-in's share the other way round.
            store(sm::fnma(d, sign * lockin_rad, per_rad, error) + (error_whole - whole_before), errors.fringes[i]);
            last_sine = sine;
            last_cosine = cosine;
            last_fringes = turn_fringes;
            last_whole = load(readings.phase_whole[i]);
            if (i + 1 == last_row) {
                store(read_sine, state.read_sine);
                store(read_cosine, state.read_cosine);
                store(load(readings.phase_fringes[i]), state.read_fringes);
                store(lockin_rad, state.read_lockin_rad);
                store(side.amplitude, state.read_amplitude_rad);
                store(side.w, state.read_angular_frequency_rad_s);
                store(side.scale_s, state.read_scale_s);
            }
        }
        store(last_amplitude, state.turn_amplitude_rad);
        store(middles_rate, state.middles_rate_rad_s);
        store(error, state.error_fringes);
        store(error_whole, state.error_whole);
        store(last_sine, state.sine);
        store(last_cosine, state.cosine);
        store(last_fringes, state.turn_fringes);
        store(last_whole, state.turn_whole);
    }
    return true;
}

}  // namespace ringlock::compensate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::compensate {

HWY_EXPORT(observe_lanes);

namespace {

constexpr double baseline_s = 16.0;     // the input rate is averaged over one to two of them
constexpr double least_margin = 0.001;  // of the amplitude
// The rate is estimated at turns that do not depend on the size of later pieces; sooner after a short first one.
constexpr std::size_t most_turns_between_estimates = 128;

}  // namespace

Exact::Exact(const Calibration& calibration, double tolerance_rad, double coupling_share)
    : calibration_(calibration), coupling_share_(coupling_share), tables_(tolerance_rad) {
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const std::size_t which = std::min(lane, calibration.lanes - 1);
        state_.amplitude_rad[lane] = calibration.dither_amplitude_rad[which];
        state_.turn_amplitude_rad[lane] = state_.amplitude_rad[lane];
        state_.middles_rate_rad_s[lane] = 0.0;
        state_.b_rad_s[lane] = calibration.b_rad_s[which];
        state_.coupling_cosine[lane] = 1.0;
        state_.duration_s[0][lane] = calibration.positive_duration_s[which];
        state_.duration_s[1][lane] = calibration.negative_duration_s[which];
        const double root = std::sqrt(state_.amplitude_rad[lane]);
        state_.scale_angle[lane] = 1.0 / root;
        for (const std::size_t side : {0U, 1U}) {
            const double w = units::pi / state_.duration_s[side][lane];
            state_.angular_frequency_rad_s[side][lane] = w;
            state_.scale_s[side][lane] = 1.0 / (w * root);
        }
    }
}

void Exact::make_tables(std::size_t lane) {
    gyro::Device device{gyro::Setup{}};
    device.coupling = {state_.b_rad_s[lane], 0.0, 0.0};
    device.dither_amplitude_rad = state_.amplitude_rad[lane];
    device.positive_duration_s = state_.duration_s[0][lane];
    device.negative_duration_s = state_.duration_s[1][lane];
    const double a = device.dither_amplitude_rad;
    const double margin = std::max(least_margin * a, calibration_.amplitude_margin_rad);
    // A rate averaged over one second is uncertain by some fringes a second.
    const double width = 16.0 * units::two_pi + 0.01 * std::abs(state_.rate_rad_s[lane]);
    const double rate = state_.rate_rad_s[lane];
    const double b = state_.b_rad_s[lane];
    const double spread = coupling_share_ * b;
    const double change = calibration_.amplitude_change_rad;
    tables_.make(lane, device,
                 {{a - margin, a + margin}, {rate - width, rate + width}, {b - spread, b + spread}, {-change, change}});
}

void Exact::see_minima(const readout::LaneReadings& readings, std::size_t first_row, std::size_t last_row,
                       const LaneErrors* errors) {
    // Minima only: the dither drops out but for its noise, which a long baseline makes small. The lock-in's share is
    // subtracted as far as it is known.
    const std::size_t first = first_row + (readings.minimum(first_row) ? 0 : 1);
    if (first >= last_row) return;
    const std::size_t last = first + (last_row - 1 - first) / 2 * 2;
    const auto point = [&](std::size_t row) {
        Minimum minimum{readings.first_turn + static_cast<std::int64_t>(row), readings.phase_fringes[row],
                        readings.phase_whole[row]};
        for (std::size_t lane = 0; errors != nullptr && lane < calibration_.lanes; ++lane) {
            minimum.fringes[lane] -= errors->fringes[row][lane];
            minimum.whole[lane] -= errors->whole[lane];
        }
        return minimum;
    };
    if (older_.turn < 0) older_ = newer_ = point(first);
    latest_ = point(last);
}

void Exact::estimate_rate() {
    const double cycles = 0.5 * static_cast<double>(latest_.turn - older_.turn);
    if (cycles == 0.0) return;
    double period_s = 0.0;
    for (std::size_t lane = 0; lane < calibration_.lanes; ++lane) {
        const double turned =
            (latest_.whole[lane] - older_.whole[lane]) + (latest_.fringes[lane] - older_.fringes[lane]);
        period_s = state_.duration_s[0][lane] + state_.duration_s[1][lane];
        state_.rate_rad_s[lane] = turned * units::two_pi / (cycles * period_s);
        changed_ = true;
    }
    // All gyros of a study are dithered at one frequency.
    if (0.5 * static_cast<double>(latest_.turn - newer_.turn) * period_s >= baseline_s) {
        older_ = newer_;
        newer_ = latest_;
    }
}

void Exact::set_coupling(std::size_t lane, double b_rad_s, double phase_rad) {
    state_.b_rad_s[lane] = b_rad_s;
    state_.coupling_cosine[lane] = std::cos(phase_rad);
    state_.coupling_sine[lane] = std::sin(phase_rad);
    changed_ = true;
}

void Exact::take_parts() {
    for (const std::size_t which : {0U, 1U}) {
        const propagate::TurnTables::Part& whole = tables_.part(which == 0 ? -1.0 : 1.0, 0);
        const auto [amplitudes, rates, couplings, changes] = whole.terms;
        propagate::TurnTables::Part& part = parts_[which];
        part.terms = {amplitudes, 1, 1, changes};
        part.coefficients.assign(3 * amplitudes * changes, simd::Lanes{});
        part.amplitude_terms.clear();
        for (std::size_t e = 0; e < changes; ++e) {
            const auto of_change = whole.amplitude_terms.begin() + static_cast<std::ptrdiff_t>(e * rates * couplings);
            part.amplitude_terms.push_back(
                *std::max_element(of_change, of_change + static_cast<std::ptrdiff_t>(rates * couplings)));
        }
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const auto scaled = [&](double value, std::size_t variable) {
                const double x =
                    (value - tables_.centre()[variable][lane]) * tables_.inverse_half_width()[variable][lane];
                return std::clamp(x, -1.0, 1.0);
            };
            const double rate_x = scaled(state_.rate_rad_s[lane], 1);
            const double coupling_x = scaled(state_.b_rad_s[lane], 2);
            for (std::size_t i = 0; i < 3 * amplitudes * changes; ++i) {
                const std::size_t change = i / (3 * amplitudes);
                const std::size_t k = i % (3 * amplitudes);
                double sum = 0.0;
                for (std::size_t c = couplings; c-- > 0;) {
                    double over_rate = 0.0;
                    for (std::size_t r = rates; r-- > 0;) {
                        const std::size_t row = 3 * amplitudes * ((change * couplings + c) * rates + r) + k;
                        over_rate = over_rate * rate_x + whole.coefficients[row][lane];
                    }
                    sum = sum * coupling_x + over_rate;
                }
                part.coefficients[i][lane] = sum;
            }
        }
    }
}

void Exact::solve(const readout::LaneReadings& readings, std::size_t first, std::size_t last, LaneErrors& errors) {
    for (std::size_t lane = 0; lane < calibration_.lanes; ++lane) {
        if (!begun_ || !tables_.ranges(lane).rate_rad_s.covers(state_.rate_rad_s[lane]) ||
            !tables_.ranges(lane).b_rad_s.covers(state_.b_rad_s[lane])) {
            make_tables(lane);
        }
    }
    if (!begun_ || changed_) take_parts();
    if (!HWY_DYNAMIC_DISPATCH(observe_lanes)(calibration_.lanes, tables_, parts_, readings, first, last, begun_,
                                             changed_, turns_, state_, errors)) {
        throw RunError(
            "compensated_exact: the phase does not reverse near a turn of the dither; "
            "the input rate is too high for it");
    }
    changed_ = false;
}

void Exact::observe(const readout::LaneReadings& readings, LaneErrors& errors) {
    observe(readings, 0, readings.turns, errors);
}

void Exact::observe(const readout::LaneReadings& readings, std::size_t first_row, std::size_t last_row,
                    LaneErrors& errors) {
    if (first_row == 0) {
        errors.resize(readings.turns);
        errors.whole = state_.error_whole;
    }
    if (first_row == last_row) return;
    std::size_t row = first_row;
    if (!begun_) {
        // The rate first from the phase as it is, then from the phase less the lock-in's share.
        row = std::min(last_row, first_row + most_turns_between_estimates);
        see_minima(readings, first_row, row, nullptr);
        estimate_rate();
        const State start = state_;
        solve(readings, first_row, row, errors);
        older_.turn = -1;
        see_minima(readings, first_row, row, &errors);
        estimate_rate();
        const simd::Lanes rate_rad_s = state_.rate_rad_s;
        state_ = start;
        state_.rate_rad_s = rate_rad_s;
        solve(readings, first_row, row, errors);
        begun_ = true;
        count_turns(row - first_row);
    }
    while (row < last_row) {
        const std::size_t rows = std::min(last_row - row, static_cast<std::size_t>(next_estimate_ - turns_));
        solve(readings, row, row + rows, errors);
        see_minima(readings, row, row + rows, &errors);
        row += rows;
        if (turns_ + static_cast<std::int64_t>(rows) < next_estimate_) {
            turns_ += static_cast<std::int64_t>(rows);
            continue;
        }
        count_turns(rows);
        estimate_rate();
    }
}

void Exact::count_turns(std::size_t rows) {
    turns_ += static_cast<std::int64_t>(rows);
    next_estimate_ = turns_ + std::clamp<std::int64_t>(turns_, 2, most_turns_between_estimates);
}

}  // namespace ringlock::compensate
#endif
