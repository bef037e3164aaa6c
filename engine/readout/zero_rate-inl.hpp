// From the dither's turn to the phase's in vector lanes, for sources that are compiled once for each instruction set.
#if defined(RINGLOCK_ZERO_RATE) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGLOCK_ZERO_RATE
#undef RINGLOCK_ZERO_RATE
#else
#define RINGLOCK_ZERO_RATE
#endif

#include "engine/gyro/lane_drive.hpp"
#include "engine/gyro/turn_series-inl.hpp"
#include "engine/readout/readout_constants.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::readout::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;
namespace gm = gyro::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

using Side = gm::UprightSide<V>;
using Extras = gm::UprightExtras<V>;

constexpr int most_steps = 20000;

/// How the phase x gets from the dither's turn to its own.
struct Walk {
    V time_s, sine, cosine;
    V lockin_rad;  ///< the lock-in's share of phase_rad
    V phase_rad;   ///< gained since the dither's turn
};

/// Jump of x at the dither's turn, where the coupling's phase varies: x is psi + that phase, turned upright.
struct Jump {
    bool any;
    V sine, cosine;
};

HWY_INLINE Jump jump_at(D d, const gyro::LaneDrive& drive, std::size_t i, std::size_t lane) {
    Jump jump{drive.phases_vary, hn::Zero(d), hn::Set(d, 1.0)};
    if (!jump.any) return jump;
    const auto phase = [&](std::size_t half)
                           HWY_ATTR { return hn::Load(d, drive.coupling_phase_fringes[half].data() + lane); };
    sm::sincos(d, hn::Set(d, drive.direction(i)) * (phase(i + 1) - phase(i)), jump.sine, jump.cosine);
    return jump;
}

/// Sine and cosine of the coupling's phase in the half cycle in which a zero-rate point lies.
struct CouplingPhase {
    V sine, cosine;
};

/// `own`: the gyro's, where the phase does not vary.
HWY_INLINE CouplingPhase coupling_phase_at(D d, const CouplingPhase& own, const gyro::LaneDrive& drive, std::size_t i,
                                           std::size_t lane, V zero_rate_s) {
    if (!drive.phases_vary) return own;
    const V before = hn::Load(d, drive.coupling_phase_fringes[i].data() + lane);
    const V after = hn::Load(d, drive.coupling_phase_fringes[i + 1].data() + lane);
    CouplingPhase phase = own;
    sm::sincos(d, hn::IfThenElse(zero_rate_s > hn::Zero(d), after, before), phase.sine, phase.cosine);
    return phase;
}

/// Goes to where the rate of x vanishes; false where some lane does not get there. x begins as that of the half cycle
/// before the dither's turn.
template <bool extras>
HWY_INLINE bool walk_to_zero_rate(D d, const Side& before, const Side& after, const Extras& extra, const Jump& jump,
                                  Walk& walk) {
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    V sine_after = walk.sine;
    V cosine_after = walk.cosine;
    if (jump.any) {
        sine_after = sm::fma(d, walk.cosine, jump.sine, walk.sine * jump.cosine);
        cosine_after = sm::fnma(d, walk.sine, jump.sine, walk.cosine * jump.cosine);
    }
    // A minimum whose phase still falls at the dither's turn lies after it.
    V first_rate = sm::fma(d, after.b, sine_after, after.rate);
    if constexpr (extras) {
        const V doubled_sine = (sine_after + sine_after) * cosine_after;
        const V doubled_cosine = sm::fnma(d, sine_after + sine_after, sine_after, one);
        const V pull =
            sm::fma(d, extra.second, sm::fma(d, doubled_sine, extra.second_cosine, doubled_cosine * extra.second_sine),
                    sine_after);
        first_rate = sm::fma(d, after.amplitude * after.w * extra.ratio, extra.harmonic_sine,
                             sm::fma(d, after.b * (one + extra.asymmetry), pull, after.rate));
    }
    const auto ahead = first_rate < zero;
    if (jump.any) {
        walk.sine = hn::IfThenElse(ahead, sine_after, walk.sine);
        walk.cosine = hn::IfThenElse(ahead, cosine_after, walk.cosine);
    }
    const Side side{
        hn::IfThenElse(ahead, after.amplitude, before.amplitude), hn::IfThenElse(ahead, after.w, before.w),
        hn::IfThenElse(ahead, after.rate, before.rate),           hn::IfThenElse(ahead, after.b, before.b),
        hn::IfThenElse(ahead, after.scale_s, before.scale_s),     hn::IfThenElse(ahead, after.angle, before.angle)};
    const V forward = hn::IfThenElse(ahead, one, hn::Neg(one));
    V sine_wt = zero;
    V cosine_wt = one;
    V time = zero;  // in scales
    hn::Mask<D> done = zero > zero;
    gm::TurnSeries<D, extras> series;
    for (int step = 0; step < most_steps; ++step) {
        series.expand(d, side, extra, sine_wt, cosine_wt, walk.sine, walk.cosine);
        // A parabola's extremum, then Newton, and again with the same slope, where that is near enough for the series.
        V root = hn::Neg(series.rate[1]) / series.rate[2];
        // A fast input with a strong coupling can curve the parabola away from zero: then, too, the walk goes on.
        const auto near = hn::And(series.rate[2] > zero, gm::within_step(d, forward * root, series.rate[1]));
        V value, slope;
        series.rate_at(d, root, value, slope);
        const V inverse = one / slope;
        root = sm::fnma(d, value, inverse, root);
        root = sm::fnma(d, series.rate_at(d, root), inverse, root);
        // A step that went too far is reversed, but not beyond the dither's turn, where the other half cycle applies.
        root = forward * hn::Max(forward * root, hn::Neg(forward * time));
        V h = root;
        if (!hn::AllTrue(d, near)) h = hn::IfThenElse(near, root, forward * gm::longest_step(d, series.rate[1]));
        h = hn::IfThenElse(done, zero, h);
        V phase, lockin;
        series.gains(d, h, phase, lockin);
        walk.phase_rad = walk.phase_rad + phase;
        walk.lockin_rad = walk.lockin_rad + lockin;
        time = time + h;
        V turn_s, turn_c;
        gm::sincos_small(d, phase, turn_s, turn_c);
        const V cosine = sm::fnma(d, walk.sine, turn_s, walk.cosine * turn_c);
        const V sine = sm::fma(d, walk.cosine, turn_s, walk.sine * turn_c);
        walk.cosine = hn::IfThenElse(done, walk.cosine, cosine);
        walk.sine = hn::IfThenElse(done, walk.sine, sine);
        done = hn::Or(done, near);
        if (hn::AllTrue(d, done)) {
            walk.time_s = time * side.scale_s;
            return true;
        }
        const V fringes = side.angle * time * hn::Set(d, 0.15915494309189535);
        if (!hn::AllTrue(d, hn::Abs(fringes) < hn::Set(d, 0.25))) return false;
        sm::sincos(d, fringes, sine_wt, cosine_wt);
    }
    return false;
}

/// Phase acceleration of a half cycle's drive at `time_s` from the turn, a magnitude [rad/s^2].
template <bool extras>
HWY_INLINE V drive_acceleration(D d, const Side& side, const Extras& extra, V time_s) {
    // cos y + 2 ratio cos(2 y + f) with y = w t <= 3/4, where a rate can still be turned round
    const V y = side.w * time_s;
    V s, c;
    gm::sincos_small(d, y * hn::Set(d, 0.25), s, c);
    V sine = (s + s) * c;
    V cosine = sm::fnma(d, s + s, s, hn::Set(d, 1.0));
    c = cosine;
    s = sine;
    sine = (s + s) * c;
    cosine = sm::fnma(d, s + s, s, hn::Set(d, 1.0));
    if constexpr (extras) {
        const V c2 = sm::fnma(d, sine + sine, sine, hn::Set(d, 1.0));
        const V s2 = (sine + sine) * cosine;
        const V harmonic = sm::fnma(d, s2, extra.harmonic_sine, c2 * extra.harmonic_cosine);
        cosine = sm::fma(d, extra.ratio + extra.ratio, harmonic, cosine);
    }
    return side.amplitude * side.w * side.w * cosine;
}

/// Root of a half cycle's acceleration at the turn, inverse.
template <bool extras>
HWY_INLINE V inverse_root_acceleration(D d, const Side& side, const Extras& extra) {
    V acceleration = side.amplitude * side.w * side.w;
    if constexpr (extras) {
        acceleration = acceleration * sm::fma(d, extra.ratio + extra.ratio, extra.harmonic_cosine, hn::Set(d, 1.0));
    }
    return hn::Set(d, 1.0) / hn::Sqrt(acceleration);
}

/// The half cycles on either side of a turn.
struct Sides {
    V sign;
    Side before, after;
    Extras extra;
    std::size_t after_side;  ///< 0: the half cycle after the turn is of positive sign
    /// Where amplitudes change over half cycles, change over amplitude of each; `before` and `after` have the amplitude
    /// at the turn, which is all that matters near it but for pulses.
    V growth[2];
};

/// The half cycles on either side of turn i of the piece.
template <bool extras>
HWY_INLINE Sides sides_at(D d, const ReadoutConstants& constants, const gyro::LaneDrive& drive, std::size_t i,
                          std::size_t lane) {
    const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
    const V zero = hn::Zero(d);
    const int direction = drive.direction(i);
    const V sign = hn::Set(d, direction);
    const std::size_t after_side = direction > 0 ? 0 : 1;
    V change[2] = {zero, zero};
    if (drive.amplitudes_change) {
        for (const std::size_t side : {0U, 1U}) change[side] = load(drive.amplitude_change_rad[i + side]);
    }
    const auto side_of = [&](std::size_t half, std::size_t which) HWY_ATTR {
        const V to_turn = change[half - i] * hn::Set(d, half == i ? 0.5 : -0.5);
        return Side{load(drive.amplitude_rad[half]) + to_turn,
                    load(constants.angular_frequency_rad_s[which]),
                    sign * load(drive.rate_rad_s[half]),
                    load(drive.b_rad_s[half]),
                    load(constants.scale_s[which]),
                    load(constants.scale_angle)};
    };
    Extras extra{zero, zero, zero, zero, zero, zero, zero};
    if constexpr (extras) {
        extra = {sign * load(constants.harmonic_ratio), load(constants.harmonic_sine),
                 load(constants.harmonic_cosine),       sign * load(constants.turn_asymmetry),
                 load(constants.second_ratio),          sign * load(constants.second_sine),
                 load(constants.second_cosine)};
    }
    const Side before = side_of(i, 1 - after_side);
    const Side after = side_of(i + 1, after_side);
    return Sides{sign, before, after, extra, after_side, {change[0] / before.amplitude, change[1] / after.amplitude}};
}

}  // namespace ringlock::readout::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
