#include "engine/propagate/turn_kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/propagate/turn_kernel.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/propagate/turn_tables-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::propagate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;
using HalfMap = HalfMapOf<V>;

/// Argument of v or q. Where no kick is strong, `strong` or not makes no difference to the result, but to the time.
template <bool strong>
HWY_INLINE V bend(D d, sm::Complex<V> a) {
    if constexpr (strong) {
        return sm::arg(d, a.re, a.im);
    } else {
        return sm::arg_right(d, a.re, a.im);
    }
}

/// `group` vectors side by side: the turns of one hide the latency of the other's. `jumping`: the coupling's phase
/// varies.
template <std::size_t group, bool turns_wanted, bool strong, bool jumping>
void step(const TurnTables& tables, const gyro::LaneDrive& drive, std::size_t first_lane, TurnState& state,
          gyro::LaneTurns* turns) {
    const D d;
    const std::size_t width = hn::Lanes(d);
    const V one = hn::Set(d, 1.0);
    const V per_half_pi = hn::Set(d, 0.3183098861837907);  // 2 rad in fringes
    V lockin[group], whole[group], phase[group], shift_before[group], re_before[group], im_before[group];
    for (std::size_t g = 0; g < group; ++g) {
        const std::size_t lane = first_lane + g * width;
        lockin[g] = hn::Load(d, state.lockin_fringes.data() + lane);
        whole[g] = hn::Zero(d);
        phase[g] = hn::Load(d, state.coupling_phase_fringes.data() + lane);
        shift_before[g] = hn::Load(d, state.shift_fringes.data() + lane);
        re_before[g] = hn::Load(d, state.z_re.data() + lane);
        im_before[g] = hn::Load(d, state.z_im.data() + lane);
        if constexpr (turns_wanted) {
            hn::Store(hn::Load(d, state.whole.data() + lane), d, turns->lockin_whole.data() + lane);
        }
    }
    const bool middles = turns_wanted && turns->middles;
    const bool changing = tables.changing();
    const bool both = changing || !tables.symmetric();
    for (std::size_t i = 0; i < drive.turns; ++i) {
        const double direction = drive.direction(i);
        const TurnTables::Part& begin = tables.part(direction, 0);
        const TurnTables::Part& end = tables.part(direction, 1);
        const V sign = hn::Set(d, direction);
        for (std::size_t g = 0; g < group; ++g) {
            const std::size_t lane = first_lane + g * width;
            const auto row = [&](const std::vector<simd::Lanes>& rows)
                                 HWY_ATTR { return hn::Load(d, rows[i + 1].data() + lane); };
            const auto scaled = [&](V value, std::size_t variable) HWY_ATTR {
                const V centre = hn::Load(d, tables.centre()[variable].data() + lane);
                return (value - centre) * hn::Load(d, tables.inverse_half_width()[variable].data() + lane);
            };
            const V y = scaled(row(drive.rate_rad_s), 1);
            const V c = scaled(row(drive.b_rad_s), 2);
            HalfMap after, next;
            if (changing) {
                // Amplitude and change as seen from either turn.
                const V middle = row(drive.amplitude_rad);
                const V change = row(drive.amplitude_change_rad);
                const V half_change = change * hn::Set(d, 0.5);
                after = evaluate(d, begin, lane, scaled(middle - half_change, 0), y, c, scaled(change, 3));
                next = evaluate(d, end, lane, scaled(middle + half_change, 0), y, c, scaled(hn::Neg(change), 3));
            } else {
                const V x = scaled(row(drive.amplitude_rad), 0);
                after = evaluate(d, begin, lane, x, y, c, hn::Zero(d));
                next = both ? evaluate(d, end, lane, x, y, c, hn::Zero(d)) : after;
            }

            // u is the phase at the turn but for the second half's own bend; p = exp(-i sign u).
            const V before_turn = sm::fnma(d, sign, shift_before[g], lockin[g]);
            if constexpr (jumping) phase[g] = hn::Load(d, drive.coupling_phase_fringes[i].data() + lane);
            const V u = hn::Load(d, drive.plain_fringes[i].data() + lane) + phase[g] + before_turn;
            V sine, cosine;
            sm::sincos(d, u, sine, cosine);
            const sm::Complex<V> p{cosine, hn::Neg(sign * sine)};
            const sm::Complex<V> z_before{re_before[g], im_before[g]};
            const sm::Complex<V> z_after{after.z_re, after.z_im};
            const sm::Complex<V> v = sm::mul_add(d, z_before, p, sm::Complex<V>{one, hn::Zero(d)});
            sm::Complex<V> w = sm::mul(d, p, sm::Complex<V>{v.re, hn::Neg(v.im)});
            if constexpr (turns_wanted) {
                // exp(-i sign psi) = p conj(v)/v
                const V inverse = one / sm::norm(d, v);
                const sm::Complex<V> e = sm::mul(d, w, sm::Complex<V>{v.re, hn::Neg(v.im)});
                hn::Store(e.re * inverse, d, turns->cosine[i].data() + lane);
                hn::Store(hn::Neg(sign * e.im * inverse), d, turns->sine[i].data() + lane);
                const V second_half = bend<strong>(d, v) * per_half_pi;
                const V at_turn = sm::fma(d, sign, second_half, before_turn);
                hn::Store(whole[g] + at_turn, d, turns->lockin_fringes[i].data() + lane);
            }
            if constexpr (jumping) {
                // psi is continuous, and psi + coupling phase jumps with the coupling phase.
                V jump_sine, jump_cosine;
                sm::sincos(d, hn::Load(d, drive.coupling_phase_fringes[i + 1].data() + lane) - phase[g], jump_sine,
                           jump_cosine);
                w = sm::mul(d, w, sm::Complex<V>{jump_cosine, hn::Neg(sign * jump_sine)});
            }
            const sm::Complex<V> q = sm::mul_add(d, z_after, w, v);
            const V gain = sm::fma(d, bend<strong>(d, q), per_half_pi, after.shift);
            // Whole fringes are removed at every turn, or rounding would depend on where a piece began. They are
            // removed from the phase before the turn, which is not in the chain of operations that a turn must wait
            // for.
            const V carry = sm::nearest(d, before_turn);
            whole[g] = whole[g] + carry;
            lockin[g] = sm::fma(d, sign, gain, before_turn - carry);
            if constexpr (turns_wanted) {
                if (middles) hn::Store(whole[g] + lockin[g], d, turns->lockin_middle_fringes[i].data() + lane);
            }
            shift_before[g] = next.shift;
            re_before[g] = next.z_re;
            im_before[g] = next.z_im;
        }
    }
    for (std::size_t g = 0; g < group; ++g) {
        const std::size_t lane = first_lane + g * width;
        hn::Store(lockin[g], d, state.lockin_fringes.data() + lane);
        hn::Store(hn::Load(d, state.whole.data() + lane) + whole[g], d, state.whole.data() + lane);
        hn::Store(shift_before[g], d, state.shift_fringes.data() + lane);
        hn::Store(re_before[g], d, state.z_re.data() + lane);
        hn::Store(im_before[g], d, state.z_im.data() + lane);
    }
}

template <bool turns_wanted, bool strong, bool jumping>
void step_all(const TurnTables& tables, const gyro::LaneDrive& drive, std::size_t lanes, TurnState& state,
              gyro::LaneTurns* turns) {
    const std::size_t width = hn::Lanes(D());
    std::size_t lane = 0;
    for (; lane + width < lanes; lane += 2 * width)
        step<2, turns_wanted, strong, jumping>(tables, drive, lane, state, turns);
    for (; lane < lanes; lane += width) step<1, turns_wanted, strong, jumping>(tables, drive, lane, state, turns);
}

template <bool jumping>
void step_any(const TurnTables& tables, const gyro::LaneDrive& drive, std::size_t lanes, TurnState& state,
              gyro::LaneTurns* turns) {
    const bool strong = tables.strong();
    if (turns != nullptr) {
        strong ? step_all<true, true, jumping>(tables, drive, lanes, state, turns)
               : step_all<true, false, jumping>(tables, drive, lanes, state, turns);
    } else {
        strong ? step_all<false, true, jumping>(tables, drive, lanes, state, turns)
               : step_all<false, false, jumping>(tables, drive, lanes, state, turns);
    }
}

void step_lanes(const TurnTables& tables, const gyro::LaneDrive& drive, std::size_t lanes, TurnState& state,
                gyro::LaneTurns* turns) {
    drive.phases_vary ? step_any<true>(tables, drive, lanes, state, turns)
                      : step_any<false>(tables, drive, lanes, state, turns);
}

void find_extremes(const std::vector<simd::Lanes>& rows, simd::Lanes& lowest, simd::Lanes& highest) {
    const D d;
    for (std::size_t lane = 0; lane < simd::lanes; lane += hn::Lanes(d)) {
        V low = hn::Load(d, rows[1].data() + lane);
        V high = low;
        for (std::size_t i = 2; i < rows.size(); ++i) {
            const V value = hn::Load(d, rows[i].data() + lane);
            low = hn::Min(low, value);
            high = hn::Max(high, value);
        }
        hn::Store(low, d, lowest.data() + lane);
        hn::Store(high, d, highest.data() + lane);
    }
}

}  // namespace ringlock::propagate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::propagate {

HWY_EXPORT(step_lanes);
HWY_EXPORT(find_extremes);

void extremes(const std::vector<simd::Lanes>& rows, simd::Lanes& lowest, simd::Lanes& highest) {
    HWY_DYNAMIC_DISPATCH(find_extremes)(rows, lowest, highest);
}

void step_turns(const TurnTables& tables, const gyro::LaneDrive& drive, std::size_t lanes, TurnState& state,
                gyro::LaneTurns* turns) {
    if (turns != nullptr) turns->resize(drive.turns);
    HWY_DYNAMIC_DISPATCH(step_lanes)(tables, drive, lanes, state, turns);
}

}  // namespace ringlock::propagate
#endif
