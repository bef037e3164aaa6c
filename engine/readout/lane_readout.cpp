#include "engine/readout/lane_readout.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/readout/lane_readout.cpp"
#include "engine/core/error.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/gyro/turn_series-inl.hpp"

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

/// Goes to where the rate of x vanishes; false where some lane does not get there.
template <bool extras>
HWY_INLINE bool walk_to_zero_rate(D d, const Side& before, const Side& after, const Extras& extra, Walk& walk) {
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    // A minimum whose phase still falls at the dither's turn lies after it.
    V first_rate = sm::fma(d, after.b, walk.sine, after.rate);
    if constexpr (extras) {
        const V doubled_sine = (walk.sine + walk.sine) * walk.cosine;
        const V doubled_cosine = sm::fnma(d, walk.sine + walk.sine, walk.sine, one);
        const V pull =
            sm::fma(d, extra.second, sm::fma(d, doubled_sine, extra.second_cosine, doubled_cosine * extra.second_sine),
                    walk.sine);
        first_rate = sm::fma(d, after.amplitude * after.w * extra.ratio, extra.harmonic_sine,
                             sm::fma(d, after.b * (one + extra.asymmetry), pull, after.rate));
    }
    const auto ahead = first_rate < zero;
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
        // A fast input beside a strong coupling can bend the parabola away from zero: then on, too.
        const auto near = hn::And(series.rate[2] > zero, gm::within_step(d, forward * root, series.rate[1]));
        V value, slope;
        series.rate_at(d, root, value, slope);
        const V inverse = one / slope;
        root = sm::fnma(d, value, inverse, root);
        root = sm::fnma(d, series.rate_at(d, root), inverse, root);
        // A step too far is taken back, but not beyond the dither's turn, where the other half cycle rules.
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

/// Times of the two pulses on both sides over the roots of twice their distances, [before, after][first, second].
struct PulseFactors {
    V values[2][2];
};

template <class Sides>
HWY_INLINE PulseFactors pulse_factors(D d, const Sides& sides, std::size_t used, std::size_t lane, hn::Mask<D> odd,
                                      hn::Mask<D> upper, V x) {
    const V zero = hn::Zero(d);
    PulseFactors sums{{{zero, zero}, {zero, zero}}};
    for (std::size_t k = used; k-- > 0;) {
        for (std::size_t side = 0; side < 2; ++side) {
            for (std::size_t pulse = 0; pulse < 2; ++pulse) {
                const PulseTables::Times& times = sides[side][pulse];
                const V low =
                    hn::IfThenElse(odd, hn::Load(d, times[1][k].data() + lane), hn::Load(d, times[0][k].data() + lane));
                const V high =
                    hn::IfThenElse(odd, hn::Load(d, times[3][k].data() + lane), hn::Load(d, times[2][k].data() + lane));
                V& sum = sums.values[side][pulse];
                sum = sm::fma(d, sum, x, hn::IfThenElse(upper, high, low));
            }
        }
    }
    return sums;
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

/// Times of the second pulse less that of the first in whole ticks, as the clock sees them [s].
HWY_INLINE V ticked_interval(D d, V tick_fraction, V first_s, V second_s, double clock_hz) {
    if (clock_hz <= 0.0) return hn::Abs(second_s - first_s);
    const V clock = hn::Set(d, clock_hz);
    const V first = hn::Floor(sm::fma(d, first_s, clock, tick_fraction));
    const V second = hn::Floor(sm::fma(d, second_s, clock, tick_fraction));
    return hn::Abs(second - first) * hn::Set(d, 1.0 / clock_hz);
}

/// Acceleration from two pulses: distance = a (t - t0)^2 / 2 at both, two equations for a and t0. `roots` is the
/// difference of the roots of twice the distances.
HWY_INLINE V acceleration_of_pulses(D d, V roots, V interval_s) {
    const V root = roots / hn::Max(interval_s, hn::Set(d, 1e-300));
    return hn::IfThenElseZero(interval_s > hn::Zero(d), root * root);
}

/// The half cycles on either side of a turn.
struct Sides {
    V sign;
    Side before, after;
    Extras extra;
    std::size_t after_side;  ///< 0: the half cycle after the turn is of positive sign
};

/// What is known of a turn so far.
struct Found {
    Walk walk;
    V quarters;  ///< phase at the zero-rate point in quarter fringes
    V error;     ///< phase read less phase, fringes
};

constexpr std::size_t turns_together = 16;

template <bool extras>
bool read_all(const LaneReadout::Constants& constants, const PulseTables& pulses, const Electronics& electronics,
              bool accelerations, std::size_t lanes, const gyro::LaneDrive& drive, const gyro::LaneTurns& turns,
              DetectorNoise noise, std::size_t stride, LaneReadings& readings, LaneAngles& angles) {
    const D d;
    const V zero = hn::Zero(d);
    const V per_rad = hn::Set(d, 0.15915494309189535);
    const V quarter = hn::Set(d, 0.25);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const V coupling_cosine = load(constants.coupling_cosine);
        const V coupling_sine = load(constants.coupling_sine);
        const V lockin_whole = load(turns.lockin_whole);
        store(lockin_whole, angles.lockin_whole);
        const auto sides_of = [&](std::size_t i) HWY_ATTR {
            const int direction = drive.direction(i);
            const V sign = hn::Set(d, direction);
            const std::size_t after_side = direction > 0 ? 0 : 1;
            const auto side_of = [&](std::size_t half, std::size_t which) HWY_ATTR {
                return Side{load(drive.amplitude_rad[half]),     load(constants.angular_frequency_rad_s[which]),
                            sign * load(drive.rate_rad_s[half]), load(drive.b_rad_s[half]),
                            load(constants.scale_s[which]),      load(constants.scale_angle)};
            };
            Extras extra{zero, zero, zero, zero, zero, zero, zero};
            if constexpr (extras) {
                extra = {sign * load(constants.harmonic_ratio), load(constants.harmonic_sine),
                         load(constants.harmonic_cosine),       sign * load(constants.turn_asymmetry),
                         load(constants.second_ratio),          sign * load(constants.second_sine),
                         load(constants.second_cosine)};
            }
            return Sides{sign, side_of(i, 1 - after_side), side_of(i + 1, after_side), extra, after_side};
        };
        V last_scale = zero;
        // A few turns at a time, step by step: what one turn does waits for itself, turns do not wait for each other,
        // and short steps let the processor work at several of them.
        Found found[turns_together];
        for (std::size_t first = 0; first < drive.turns; first += turns_together * stride) {
            const std::size_t end = std::min(drive.turns, first + turns_together * stride);
            for (std::size_t i = first; i < end; i += stride) {
                const Sides sides = sides_of(i);
                Walk& walk = found[(i - first) / stride].walk;
                walk = {zero, sides.sign * load(turns.sine[i]), load(turns.cosine[i]), zero, zero};
                if (!walk_to_zero_rate<extras>(d, sides.before, sides.after, sides.extra, walk)) return false;
            }
            for (std::size_t i = first; i < end; i += stride) {
                const int direction = drive.direction(i);
                const V sign = hn::Set(d, direction);
                const Walk& walk = found[(i - first) / stride].walk;
                const V lockin = sm::fma(d, sign * walk.lockin_rad, per_rad, load(turns.lockin_fringes[i]));
                store(lockin, angles.lockin_fringes[i]);
                // psi at the zero-rate point, in fringes less whole ones that are added where the phase is reported.
                const V phase = sm::fma(d, sign * walk.phase_rad, per_rad,
                                        load(drive.plain_fringes[i]) + load(turns.lockin_fringes[i]));
                const V true_sine = sm::fnma(d, walk.cosine, coupling_sine, sign * walk.sine * coupling_cosine);
                const V true_cosine = sm::fma(d, sign * walk.sine, coupling_sine, walk.cosine * coupling_cosine);

                V sine = true_sine;
                V cosine = true_cosine;
                V error = zero;  // phase read less phase, fringes
                if (!electronics.ideal) {
                    sine = sm::fma(d, sine, load(constants.gain), load(constants.offset_sin));
                    cosine = sm::fnma(
                        d, true_sine, load(constants.orthogonality_sine),
                        sm::fma(d, true_cosine, load(constants.orthogonality_cosine), load(constants.offset_cos)));
                    if (!noise.empty()) {
                        const V rms = hn::Set(d, electronics.detector_noise_relative);
                        sine = sm::fma(d, rms, load(noise[2 * i]), sine);
                        cosine = sm::fma(d, rms, load(noise[2 * i + 1]), cosine);
                    }
                    error = sm::arg(d, sm::fma(d, cosine, true_cosine, sine * true_sine),
                                    sm::fnma(d, cosine, true_sine, sine * true_cosine)) *
                            per_rad;
                }
                // The counter names the quarter fringe; the quadrature's phase is taken on the branch nearest its
                // middle.
                const V quarters = phase * hn::Set(d, 4.0);
                const V in_quarter = (quarters - hn::Floor(quarters) - hn::Set(d, 0.5)) * quarter;
                error = sm::fraction(d, in_quarter + error) - in_quarter;
                store(sine, readings.sine[i]);
                store(cosine, readings.cosine[i]);
                store(phase + error, readings.phase_fringes[i]);
                const V swing = direction > 0 ? zero : load(constants.swing_whole);
                store(load(drive.rotation_whole[i]) + lockin_whole + swing, readings.phase_whole[i]);
                const V output_error = electronics.interpolate ? error : hn::Neg(in_quarter);
                store(load(drive.rotation_fringes[i]) + lockin + output_error, angles.angle_fringes[i]);
                store(load(drive.rotation_whole[i]) + lockin_whole, angles.angle_whole[i]);
                found[(i - first) / stride].quarters = quarters;
                found[(i - first) / stride].error = error;
            }
            if (!accelerations) continue;
            for (std::size_t i = first; i < end; i += stride) {
                const auto& [sign, before, after, extra, after_side] = sides_of(i);
                const auto& [walk, quarters, error] = found[(i - first) / stride];
                if (electronics.ideal) {
                    store(drive_acceleration<extras>(d, before, extra, walk.time_s), readings.accel_before_rad_s2[i]);
                    store(drive_acceleration<extras>(d, after, extra, walk.time_s), readings.accel_after_rad_s2[i]);
                    continue;
                }
                // Comparators switch at whole quarter fringes of the true phase; how far these are from the extremum
                // the electronics know only through the phase they measured.
                const V upright = sign * quarters;
                const V floor = hn::Floor(upright);
                const V first_quarters = floor + hn::Set(d, 1.0) - upright;  // (0, 1]
                const V quarter_rad = hn::Set(d, 1.5707963267948966);
                const V near = first_quarters * quarter_rad;
                const V far = near + quarter_rad;
                const V index = floor - hn::Set(d, 4.0) * hn::Floor(floor * quarter);  // 0...3
                const auto upper = index > hn::Set(d, 1.5);
                const V in_pair = index - hn::IfThenElseZero(upper, hn::Set(d, 2.0));
                const auto odd = in_pair > hn::Set(d, 0.5);
                const V near_root = hn::Sqrt(near + near);
                const V x = sm::fma(d, near_root, hn::Set(d, 1.1283791670955126), hn::Set(d, -1.0));  // 2/sqrt(pi)
                const V far_root = hn::Sqrt(far + far);
                const V error_rad = sign * error * hn::Set(d, 6.283185307179586);
                const V twice_near = (near - error_rad) + (near - error_rad);
                const V twice_far = (far - error_rad) + (far - error_rad);
                const V measured_roots = hn::Sqrt(hn::Max(twice_far, zero)) - hn::Sqrt(hn::Max(twice_near, zero));
                V tick_fraction = zero;
                if (electronics.clock_hz > 0.0) {
                    const std::int64_t turn = drive.first_turn + static_cast<std::int64_t>(i);
                    const V clock = hn::Set(d, electronics.clock_hz);
                    const V cycles = hn::Set(d, static_cast<double>(turn / 2));
                    V time = cycles * (load(constants.duration_s[0]) + load(constants.duration_s[1]));
                    if (turn % 2 != 0) time = time + load(constants.duration_s[0]);
                    const V ticks = time * clock;
                    tick_fraction = ticks - hn::Floor(ticks);
                }
                const PulseFactors factors =
                    pulse_factors(d, pulses.times[after_side], pulses.used, lane, odd, upper, x);
                const V turned_s = walk.time_s;
                const auto side_acceleration = [&](std::size_t which, V scale) HWY_ATTR {
                    const V first_s = sm::fma(d, near_root * scale, factors.values[which][0], turned_s);
                    const V second_s = sm::fma(d, far_root * scale, factors.values[which][1], turned_s);
                    const V interval = ticked_interval(d, tick_fraction, first_s, second_s, electronics.clock_hz);
                    return acceleration_of_pulses(d, measured_roots, interval);
                };
                // The half cycle after this turn is the one before the next, unless its two ends differ.
                const V scale_before =
                    extras || i == 0 || stride != 1 ? inverse_root_acceleration<extras>(d, before, extra) : last_scale;
                const V scale_after = inverse_root_acceleration<extras>(d, after, extra);
                last_scale = scale_after;
                store(side_acceleration(0, hn::Neg(scale_before)), readings.accel_before_rad_s2[i]);
                store(side_acceleration(1, scale_after), readings.accel_after_rad_s2[i]);
            }
        }
    }
    return true;
}

bool read_lanes(const LaneReadout::Constants& constants, const PulseTables& pulses, const Electronics& electronics,
                bool accelerations, bool extras, std::size_t lanes, const gyro::LaneDrive& drive,
                const gyro::LaneTurns& turns, DetectorNoise noise, std::size_t stride, LaneReadings& readings,
                LaneAngles& angles) {
    const auto read = extras ? read_all<true> : read_all<false>;
    return read(constants, pulses, electronics, accelerations, lanes, drive, turns, noise, stride, readings, angles);
}

}  // namespace ringlock::readout::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::readout {

HWY_EXPORT(read_lanes);

LaneReadout::LaneReadout(std::span<const gyro::Device> devices, std::span<const gyro::Ellipse> ellipses,
                         const Electronics& electronics, bool with_pulses)
    : lanes_(devices.size()), electronics_(electronics), with_accelerations_(with_pulses) {
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const std::size_t which = std::min(lane, devices.size() - 1);
        const gyro::Device& device = devices[which];
        const gyro::Ellipse& ellipse = ellipses[which];
        constants_.duration_s[0][lane] = device.positive_duration_s;
        constants_.duration_s[1][lane] = device.negative_duration_s;
        for (const std::size_t side : {0U, 1U}) {
            constants_.angular_frequency_rad_s[side][lane] = units::pi / constants_.duration_s[side][lane];
        }
        constants_.harmonic_ratio[lane] = device.harmonic_ratio;
        constants_.harmonic_sine[lane] = std::sin(device.harmonic_phase_rad);
        constants_.harmonic_cosine[lane] = std::cos(device.harmonic_phase_rad);
        constants_.turn_asymmetry[lane] = device.coupling.turn_asymmetry;
        constants_.coupling_cosine[lane] = std::cos(device.coupling.phase_rad);
        constants_.coupling_sine[lane] = std::sin(device.coupling.phase_rad);
        constants_.gain[lane] = 1.0 + ellipse.gain;
        constants_.offset_sin[lane] = ellipse.offset_sin;
        constants_.offset_cos[lane] = ellipse.offset_cos;
        constants_.orthogonality_cosine[lane] = std::cos(ellipse.orthogonality_rad);
        constants_.orthogonality_sine[lane] = std::sin(ellipse.orthogonality_rad);
        constants_.swing_whole[lane] = std::nearbyint(2.0 * device.dither_amplitude_rad / units::two_pi);
        constants_.second_ratio[lane] = device.coupling.second_ratio;
        constants_.second_sine[lane] = std::sin(device.coupling.second_from_first_rad());
        constants_.second_cosine[lane] = std::cos(device.coupling.second_from_first_rad());
        extras_ = extras_ || device.coupling.second_ratio != 0.0 || device.coupling.turn_asymmetry != 0.0 ||
                  device.harmonic_ratio != 0.0;
        const double root = std::sqrt(device.dither_amplitude_rad);
        constants_.scale_angle[lane] = 1.0 / root;
        for (const std::size_t side : {0U, 1U}) {
            constants_.scale_s[side][lane] = 1.0 / (constants_.angular_frequency_rad_s[side][lane] * root);
        }
        if (with_pulses && !electronics.ideal) pulses_.make(lane, device);
    }
}

void LaneReadout::read(const gyro::LaneDrive& drive, const gyro::LaneTurns& turns, DetectorNoise noise,
                       std::size_t stride, LaneReadings& readings, LaneAngles& angles) const {
    readings.first_turn = drive.first_turn;
    readings.resize(drive.turns);
    angles.resize(drive.turns);
    if (!HWY_DYNAMIC_DISPATCH(read_lanes)(constants_, pulses_, electronics_, with_accelerations_, extras_, lanes_,
                                          drive, turns, noise, stride, readings, angles)) {
        throw RunError(
            "readout: the phase does not reverse near a turn of the dither; the input rate is too high for it");
    }
}

}  // namespace ringlock::readout
#endif
