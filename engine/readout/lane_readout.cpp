#include "engine/readout/lane_readout.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/readout/lane_readout.cpp"
#include "engine/core/error.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::readout::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

constexpr std::size_t order = 9;  // of the Taylor series from the dither's turn to the phase's
constexpr int most_steps = 4000;

/// A half cycle next to a turn, turned upright: x' = rate + A w (sin(w t) + ratio sin(2 w t + f)) + b(t) sin(x) with t
/// from the dither's turn, in either direction.
struct Side {
    V amplitude, w, rate, b;
};

/// Phase x, cosine and sine of it, and the lock-in's share, as they go from the dither's turn to the phase's.
struct Walk {
    V time_s, cosine, sine;
    V lockin_rad;  // gained since the dither's turn
    V phase_rad;   // gained since the dither's turn
};

/// \return false where some lane does not get there
HWY_INLINE bool walk_to_zero_rate(D d, const Side& before, const Side& after, V ratio, V harmonic_phase_fringes,
                                  V harmonic_sine, V harmonic_cosine, V asymmetry, Walk& walk, V& forward_side) {
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    const V first_rate = sm::fma(d, after.amplitude * after.w * ratio, harmonic_sine,
                                 sm::fma(d, after.b * (one + asymmetry), walk.sine, after.rate));
    const auto ahead = first_rate < zero;
    const V amplitude = hn::IfThenElse(ahead, after.amplitude, before.amplitude);
    const V w = hn::IfThenElse(ahead, after.w, before.w);
    const V rate = hn::IfThenElse(ahead, after.rate, before.rate);
    const V b = hn::IfThenElse(ahead, after.b, before.b);
    forward_side = hn::IfThenElse(ahead, one, hn::Neg(one));
    const V scale = one / hn::Sqrt(amplitude * w * w);
    const V step_angle = w * scale;
    V s1 = zero;
    V c1 = one;
    V s2 = harmonic_sine;
    V c2 = harmonic_cosine;
    hn::Mask<D> done = zero > zero;
    for (int step = 0; step < most_steps; ++step) {
        // Taylor coefficients in units of the scale.
        V first = amplitude * step_angle;
        V second = first * ratio;
        const V beta = b * scale;
        const V swing = beta * asymmetry;
        const V couplings[3] = {sm::fma(d, swing, c1, beta), hn::Neg(swing * step_angle * s1),
                                hn::Neg(swing * step_angle * step_angle * c1 * hn::Set(d, 0.5))};
        V sines[order], cosines[order], weighted[order + 1], lockin[order + 1], drive[order];
        for (std::size_t n = 0; n < order; ++n) {
            const V sine = n % 4 == 0 ? s1 : n % 4 == 1 ? c1 : n % 4 == 2 ? hn::Neg(s1) : hn::Neg(c1);
            const V doubled = n % 4 == 0 ? s2 : n % 4 == 1 ? c2 : n % 4 == 2 ? hn::Neg(s2) : hn::Neg(c2);
            drive[n] = sm::fma(d, first, sine, second * doubled);
            const V factor = step_angle * hn::Set(d, 1.0 / static_cast<double>(n + 1));
            first = first * factor;
            second = second * (factor + factor);
        }
        drive[0] = sm::fma(d, rate, scale, drive[0]);
        sines[0] = walk.sine;
        cosines[0] = walk.cosine;
        weighted[0] = zero;
        for (std::size_t n = 0; n < order; ++n) {
            if (n > 0) {
                V sum_s = zero;
                V sum_c = zero;
                for (std::size_t j = 1; j <= n; ++j) {
                    sum_s = sm::fma(d, weighted[j], cosines[n - j], sum_s);
                    sum_c = sm::fma(d, weighted[j], sines[n - j], sum_c);
                }
                const V inverse = hn::Set(d, 1.0 / static_cast<double>(n));
                sines[n] = sum_s * inverse;
                cosines[n] = hn::Neg(sum_c * inverse);
            }
            V pull = couplings[0] * sines[n];
            for (std::size_t j = 1; j <= n && j < 3; ++j) pull = sm::fma(d, couplings[j], sines[n - j], pull);
            lockin[n + 1] = pull;  // (n + 1) times the coefficient
            weighted[n + 1] = drive[n] + pull;
        }
        // A step within which neither time nor phase goes far enough for the series to lose digits.
        const V limit = hn::Min(hn::Set(d, 0.25), hn::Set(d, 0.25) / hn::Max(hn::Abs(weighted[1]), hn::Set(d, 1e-3)));
        // Root of the rate: a parabola's extremum, then Newton where that is near enough for the series to hold.
        V root = hn::Neg(weighted[1]) / weighted[2];
        const auto near = forward_side * root <= limit;
        for (int i = 0; i < 2; ++i) {
            V value = weighted[order];
            V slope = weighted[order] * hn::Set(d, static_cast<double>(order - 1));
            for (std::size_t n = order - 1; n >= 1; --n) {
                value = sm::fma(d, value, root, weighted[n]);
                if (n >= 2) slope = sm::fma(d, slope, root, weighted[n] * hn::Set(d, static_cast<double>(n - 1)));
            }
            root = root - value / slope;
        }
        // A step too far is taken back, but not beyond the dither's turn, where the other half cycle rules.
        root = forward_side * hn::Max(forward_side * root, hn::Neg(forward_side * walk.time_s / scale));
        V h = hn::IfThenElse(near, root, forward_side * limit);
        h = hn::IfThenElse(done, zero, h);
        V phase = weighted[order] * hn::Set(d, 1.0 / static_cast<double>(order));
        V gained = lockin[order] * hn::Set(d, 1.0 / static_cast<double>(order));
        for (std::size_t n = order - 1; n >= 1; --n) {
            const V inverse = hn::Set(d, 1.0 / static_cast<double>(n));
            phase = sm::fma(d, phase, h, weighted[n] * inverse);
            gained = sm::fma(d, gained, h, lockin[n] * inverse);
        }
        phase = phase * h;
        walk.phase_rad = walk.phase_rad + phase;
        walk.lockin_rad = sm::fma(d, gained, h, walk.lockin_rad);
        walk.time_s = sm::fma(d, h, scale, walk.time_s);
        V turn_s;
        V turn_c;
        sm::sincos(d, phase * hn::Set(d, 0.15915494309189535), turn_s, turn_c);
        const V cosine = sm::fnma(d, walk.sine, turn_s, walk.cosine * turn_c);
        const V sine = sm::fma(d, walk.cosine, turn_s, walk.sine * turn_c);
        walk.cosine = hn::IfThenElse(done, walk.cosine, cosine);
        walk.sine = hn::IfThenElse(done, walk.sine, sine);
        done = hn::Or(done, near);
        if (hn::AllTrue(d, done)) return true;
        const V fringes = w * walk.time_s * hn::Set(d, 0.15915494309189535);
        if (!hn::AllTrue(d, hn::Abs(fringes) < hn::Set(d, 0.25))) return false;
        sm::sincos(d, fringes, s1, c1);
        sm::sincos(d, fringes + fringes + harmonic_phase_fringes, s2, c2);
    }
    return false;
}

/// Phase acceleration of a half cycle's drive at `time_s` from the turn, a magnitude [rad/s^2].
HWY_INLINE V drive_acceleration(D d, const Side& side, V ratio, V harmonic_sine, V harmonic_cosine, V time_s) {
    const V y = side.w * time_s;
    V s, c;
    sm::sincos(d, y * hn::Set(d, 0.15915494309189535), s, c);
    // cos y + 2 ratio cos(2 y + f)
    const V c2 = sm::fnma(d, s + s, s, hn::Set(d, 1.0));
    const V s2 = (s + s) * c;
    const V harmonic = sm::fnma(d, s2, harmonic_sine, c2 * harmonic_cosine);
    return side.amplitude * side.w * side.w * sm::fma(d, ratio + ratio, harmonic, c);
}

template <class Times>
HWY_INLINE V pulse_factor(D d, const Times& times, std::size_t lane, hn::Mask<D> odd, hn::Mask<D> upper, V x) {
    V sum = hn::Zero(d);
    for (std::size_t k = PulseTables::terms; k-- > 0;) {
        const V q0 = hn::Load(d, times[0][k].data() + lane);
        const V q1 = hn::Load(d, times[1][k].data() + lane);
        const V q2 = hn::Load(d, times[2][k].data() + lane);
        const V q3 = hn::Load(d, times[3][k].data() + lane);
        const V low = hn::IfThenElse(odd, q1, q0);
        const V high = hn::IfThenElse(odd, q3, q2);
        sum = sm::fma(d, sum, x, hn::IfThenElse(upper, high, low));
    }
    return sum;
}

/// Times of the second pulse less that of the first in whole ticks, as the clock sees them [s].
HWY_INLINE V ticked_interval(D d, V tick_fraction, V first_s, V second_s, double clock_hz) {
    if (clock_hz <= 0.0) return hn::Abs(second_s - first_s);
    const V clock = hn::Set(d, clock_hz);
    const V first = hn::Floor(sm::fma(d, first_s, clock, tick_fraction));
    const V second = hn::Floor(sm::fma(d, second_s, clock, tick_fraction));
    return hn::Abs(second - first) * hn::Set(d, 1.0 / clock_hz);
}

/// Acceleration from two pulses: distance = a (t - t0)^2 / 2 at both, two equations for a and t0.
HWY_INLINE V acceleration_of_pulses(D d, V near_rad, V far_rad, V interval_s) {
    const V zero = hn::Zero(d);
    const V root = (hn::Sqrt(hn::Max(far_rad + far_rad, zero)) - hn::Sqrt(hn::Max(near_rad + near_rad, zero))) /
                   hn::Max(interval_s, hn::Set(d, 1e-300));
    return hn::IfThenElseZero(interval_s > zero, root * root);
}

bool read_lanes(const LaneReadout::Constants& constants, const PulseTables& pulses, const Electronics& electronics,
                bool accelerations, std::size_t lanes, const gyro::LaneDrive& drive, const gyro::LaneTurns& turns,
                DetectorNoise noise, std::size_t stride, LaneReadings& readings, LaneAngles& angles) {
    const D d;
    const V zero = hn::Zero(d);
    const V per_rad = hn::Set(d, 0.15915494309189535);
    const V quarter = hn::Set(d, 0.25);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const V harmonic_sine = load(constants.harmonic_sine);
        const V harmonic_cosine = load(constants.harmonic_cosine);
        const V harmonic_phase = load(constants.harmonic_phase_fringes);
        const V coupling_cosine = load(constants.coupling_cosine);
        const V coupling_sine = load(constants.coupling_sine);
        const V lockin_whole = load(turns.lockin_whole);
        store(lockin_whole, angles.lockin_whole);
        for (std::size_t i = 0; i < drive.turns; i += stride) {
            const int direction = drive.direction(i);
            const V sign = hn::Set(d, direction);
            const std::size_t after_side = direction > 0 ? 0 : 1;
            const std::size_t before_side = 1 - after_side;
            const Side before{load(drive.amplitude_rad[i]), load(constants.angular_frequency_rad_s[before_side]),
                              sign * load(drive.rate_rad_s[i]), load(drive.b_rad_s[i])};
            const Side after{load(drive.amplitude_rad[i + 1]), load(constants.angular_frequency_rad_s[after_side]),
                             sign * load(drive.rate_rad_s[i + 1]), load(drive.b_rad_s[i + 1])};
            const V ratio = sign * load(constants.harmonic_ratio);
            Walk walk{zero, load(turns.cosine[i]), sign * load(turns.sine[i]), zero, zero};
            V ahead;
            if (!walk_to_zero_rate(d, before, after, ratio, harmonic_phase, harmonic_sine, harmonic_cosine,
                                   sign * load(constants.turn_asymmetry), walk, ahead)) {
                return false;
            }
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
                cosine = sm::fnma(d, true_sine, load(constants.orthogonality_sine),
                                  sm::fma(d, true_cosine, load(constants.orthogonality_cosine),
                                          load(constants.offset_cos)));
                if (!noise.empty()) {
                    const V rms = hn::Set(d, electronics.detector_noise_relative);
                    sine = sm::fma(d, rms, load(noise[2 * i]), sine);
                    cosine = sm::fma(d, rms, load(noise[2 * i + 1]), cosine);
                }
                error = sm::arg(d, sm::fma(d, cosine, true_cosine, sine * true_sine),
                                sm::fnma(d, cosine, true_sine, sine * true_cosine)) *
                        per_rad;
            }
            // The counter names the quarter fringe; the quadrature's phase is taken on the branch nearest its middle.
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
            if (!accelerations) continue;

            if (electronics.ideal) {
                store(drive_acceleration(d, before, ratio, harmonic_sine, harmonic_cosine, walk.time_s),
                      readings.accel_before_rad_s2[i]);
                store(drive_acceleration(d, after, ratio, harmonic_sine, harmonic_cosine, walk.time_s),
                      readings.accel_after_rad_s2[i]);
                continue;
            }
            // Comparators switch at whole quarter fringes of the true phase; how far these are from the extremum the
            // electronics know only through the phase they measured.
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
            const V x = sm::fma(d, first_quarters, hn::Set(d, 2.0), hn::Set(d, -1.0));
            const V near_root = hn::Sqrt(near + near);
            const V far_root = hn::Sqrt(far + far);
            const V error_rad = sign * error * hn::Set(d, 6.283185307179586);
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
            const auto side_acceleration = [&](const Side& side, std::size_t which, V which_sign) HWY_ATTR {
                const auto& tables = pulses.times[after_side][which];
                const V harmonic = sm::fma(d, ratio + ratio, harmonic_cosine, hn::Set(d, 1.0));
                const V scale = which_sign / hn::Sqrt(side.amplitude * side.w * side.w * harmonic);
                const V first_s = sm::fma(d, near_root * scale, pulse_factor(d, tables[0], lane, odd, upper, x), walk.time_s);
                const V second_s = sm::fma(d, far_root * scale, pulse_factor(d, tables[1], lane, odd, upper, x), walk.time_s);
                const V interval = ticked_interval(d, tick_fraction, first_s, second_s, electronics.clock_hz);
                return acceleration_of_pulses(d, near - error_rad, far - error_rad, interval);
            };
            store(side_acceleration(before, 0, hn::Set(d, -1.0)), readings.accel_before_rad_s2[i]);
            store(side_acceleration(after, 1, hn::Set(d, 1.0)), readings.accel_after_rad_s2[i]);
        }
    }
    return true;
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
        constants_.harmonic_phase_fringes[lane] = device.harmonic_phase_rad / units::two_pi;
        constants_.turn_asymmetry[lane] = device.coupling.turn_asymmetry;
        constants_.coupling_cosine[lane] = std::cos(device.coupling.phase_rad);
        constants_.coupling_sine[lane] = std::sin(device.coupling.phase_rad);
        constants_.gain[lane] = 1.0 + ellipse.gain;
        constants_.offset_sin[lane] = ellipse.offset_sin;
        constants_.offset_cos[lane] = ellipse.offset_cos;
        constants_.orthogonality_cosine[lane] = std::cos(ellipse.orthogonality_rad);
        constants_.orthogonality_sine[lane] = std::sin(ellipse.orthogonality_rad);
        constants_.swing_whole[lane] = std::nearbyint(2.0 * device.dither_amplitude_rad / units::two_pi);
        if (with_pulses && !electronics.ideal) pulses_.make(lane, device);
    }
}

void LaneReadout::read(const gyro::LaneDrive& drive, const gyro::LaneTurns& turns, DetectorNoise noise,
                       std::size_t stride, LaneReadings& readings, LaneAngles& angles) const {
    readings.first_turn = drive.first_turn;
    readings.resize(drive.turns);
    angles.resize(drive.turns);
    if (!HWY_DYNAMIC_DISPATCH(read_lanes)(constants_, pulses_, electronics_, with_accelerations_, lanes_, drive, turns,
                                          noise, stride, readings, angles)) {
        throw RunError("readout: the phase does not reverse near a turn of the dither; the input rate is too high for it");
    }
}

}  // namespace ringlock::readout
#endif
