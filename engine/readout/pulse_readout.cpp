#include "engine/readout/pulse_readout.hpp"

#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/readout/pulse_readout.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/readout/pulse_tables-inl.hpp"
#include "engine/readout/zero_rate-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::readout::HWY_NAMESPACE {

/// A detector's voltage as the converter gives it.
HWY_INLINE V converted(D d, V value, double steps) {
    if (steps == 0.0) return value;
    const V range = hn::Set(d, Electronics::adc_range);
    const V code = sm::nearest(d, hn::Max(hn::Min(value, range), hn::Neg(range)) * hn::Set(d, steps));
    return code * hn::Set(d, 1.0 / steps);
}

/// Acceleration from the times of two pulses and the roots of twice their distances.
HWY_INLINE V acceleration_of(D d, V near_root, V far_root, V interval_s) {
    const V root = (far_root - near_root) / hn::Max(interval_s, hn::Set(d, 1e-300));
    return hn::IfThenElseZero(interval_s > hn::Zero(d), root * root);
}

template <bool extras>
bool read_all(const ReadoutConstants& constants, std::span<const PulseTables> tables, const Electronics& electronics,
              std::size_t lanes, const gyro::LaneDrive& drive, const gyro::LaneTurns& turns,
              const ElectronicNoise& noise, LaneReadings& readings, LaneAngles& angles) {
    const D d;
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    const V half = hn::Set(d, 0.5);
    const V quarter = hn::Set(d, 0.25);
    const V quarter_rad = hn::Set(d, 1.5707963267948966);
    const V per_rad = hn::Set(d, 0.15915494309189535);
    const V hysteresis = hn::Set(d, electronics.ideal ? 0.0 : electronics.comparator_hysteresis_relative);
    const V detector_rms = hn::Set(d, electronics.detector_noise_relative);
    const V comparator_rms = hn::Set(d, electronics.comparator_noise_relative);
    const double low_pass = low_pass_s(electronics);
    const V blunting = hn::Set(d, 0.5 * low_pass * low_pass);
    const V least = hn::Set(d, least_distance_rad(electronics));
    const double steps = electronics.adc_bits > 0 && !electronics.ideal
                             ? std::ldexp(0.5, electronics.adc_bits) / Electronics::adc_range
                             : 0.0;
    const bool clocked = electronics.clock_hz > 0.0 && !electronics.ideal;
    const V clock = hn::Set(d, clocked ? electronics.clock_hz : 1.0);
    const V tick_s = hn::Set(d, clocked ? 1.0 / electronics.clock_hz : 1.0);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const CouplingPhase own{load(constants.coupling_sine), load(constants.coupling_cosine)};
        const V lockin_whole = load(turns.lockin_whole);
        store(lockin_whole, angles.lockin_whole);
        for (std::size_t i = 0; i < drive.turns; ++i) {
            const auto [sign, before, after, extra, after_side, growth] =
                sides_at<extras>(d, constants, drive, i, lane);
            Walk walk{zero, sign * load(turns.sine[i]), load(turns.cosine[i]), zero, zero};
            if (!walk_to_zero_rate<extras>(d, before, after, extra, jump_at(d, drive, i, lane), walk)) return false;
            const V lockin = sm::fma(d, sign * walk.lockin_rad, per_rad, load(turns.lockin_fringes[i]));
            store(lockin, angles.lockin_fringes[i]);
            // psi at the zero-rate point, in fringes less whole ones that are added where the phase is reported.
            const V phase = sm::fma(d, sign * walk.phase_rad, per_rad,
                                    load(drive.plain_fringes[i]) + load(turns.lockin_fringes[i]));
            if (!angles.phase_fringes.empty()) {
                store(phase, angles.phase_fringes[i]);
                store(walk.time_s, angles.zero_rate_s[i]);
            }
            const CouplingPhase coupling = coupling_phase_at(d, own, drive, i, lane, walk.time_s);
            const V true_sine = sm::fnma(d, walk.cosine, coupling.sine, sign * walk.sine * coupling.cosine);
            const V true_cosine = sm::fma(d, sign * walk.sine, coupling.sine, walk.cosine * coupling.cosine);

            // The path: distances of quarter fringes from the extremum and the times at which they are passed.
            const V upright = sign * phase * hn::Set(d, 4.0);
            const V floor = hn::Floor(upright);
            const V near = (floor + one - upright) * quarter_rad;
            const V near_root = hn::Sqrt(near + near);
            const V x = sm::fma(d, near_root, hn::Set(d, 1.1283791670955126), hn::Neg(one));  // 2/sqrt(pi)
            const PhaseWeights<V> weights = phase_weights(d, constants, drive, i, lane);
            const auto factors =
                pulse_factors<kept_pulses>(d, tables, after_side, lane, quarter_of(d, floor), x, weights);
            const V scale[2] = {inverse_root_acceleration<extras>(d, before, extra),
                                inverse_root_acceleration<extras>(d, after, extra)};
            const V bend[2] = {before.b * scale[0] * load(tables[0].inverse_bend[1 - after_side]),
                               after.b * scale[1] * load(tables[0].inverse_bend[after_side])};
            const V curve[2] = {before.w * before.w * scale[0] * scale[0], after.w * after.w * scale[1] * scale[1]};
            // An amplitude that grows by the share g over a half cycle bends the path by g (w t)^3/(3 pi), of (w
            // t)^2/2.
            const V per_three_pi = hn::Set(d, 0.10610329539459689);
            const V swell[2] = {growth[0] * before.w * scale[0] * per_three_pi,
                                hn::Neg(growth[1]) * after.w * scale[1] * per_three_pi};
            // The parabola of the half cycle that does not contain the extremum has its vertex elsewhere: at the time
            // t_0 a/a', and its phase, counted from the dither's turn, is scaled likewise.
            const V t0 = walk.time_s;
            const auto late = t0 > zero;
            const V a_here = one / hn::IfThenElse(late, scale[1] * scale[1], scale[0] * scale[0]);
            const V there = hn::IfThenElse(late, scale[0] * scale[0], scale[1] * scale[1]);
            const V ratio = a_here * there;
            const V shallower = half * t0 * t0 * a_here * (ratio - one);
            const V start[2] = {hn::IfThenElse(late, t0 * ratio, t0), hn::IfThenElse(late, t0, t0 * ratio)};
            const V farther[2] = {hn::IfThenElseZero(late, shallower), hn::IfThenZeroElse(late, shallower)};

            // Ticks of the clock, counted from the one before the dither's turn.
            V tick_fraction = zero;
            if (clocked) {
                const std::int64_t turn = drive.first_turn + static_cast<std::int64_t>(i);
                V time = hn::Set(d, static_cast<double>(turn / 2)) *
                         (load(constants.duration_s[0]) + load(constants.duration_s[1]));
                if (turn % 2 != 0) time = time + load(constants.duration_s[0]);
                const V ticks = time * clock;
                tick_fraction = ticks - hn::Floor(ticks);
            }
            const auto tick = [&](V time_s) HWY_ATTR {
                return clocked ? hn::Floor(sm::fma(d, time_s, clock, tick_fraction)) : time_s;
            };

            // Comparators: how far from the extremum they switch, and when.
            V seen[2][kept_pulses];
            V distance[2][2];  // of the first pulse on either side: kept for whether it is there at all
            for (std::size_t pulse = 0; pulse < kept_pulses; ++pulse) {
                const V number = floor + hn::Set(d, static_cast<double>(pulse + 1));
                const auto which = quarter_of(d, sign * number);
                const V shift = sign * pick(d, which, constants.comparator_shift_rad, lane);
                const V per_amplitude = one / pick(d, which, constants.comparator_amplitude, lane);
                const V nominal = sm::fma(d, hn::Set(d, static_cast<double>(pulse)), quarter_rad, near);
                for (std::size_t side = 0; side < 2; ++side) {
                    V off = side == 0 ? hn::Neg(hysteresis) : hysteresis;
                    if (!noise.comparators.empty()) {
                        off = sm::fma(d, comparator_rms,
                                      load(noise.comparators[2 * kept_pulses * i + kept_pulses * side + pulse]), off);
                    }
                    V gone = nominal;
                    if (!electronics.ideal) gone = nominal + sm::fma(d, off, per_amplitude, shift);
                    gone = gone + farther[side];
                    gone = sm::fnma(d, blunting, one / (scale[side] * scale[side]), gone);
                    if (pulse == 0) distance[side][0] = gone;
                    const V factor =
                        sm::fma(d, bend[side], factors.values[side][pulse], sinusoid_factor(d, curve[side] * nominal));
                    const V root = hn::Sqrt(hn::Max(gone + gone, zero));
                    const V magnitude = root * scale[side] * sm::fma(d, swell[side], root, factor);
                    seen[side][pulse] = tick(side == 0 ? start[0] - magnitude : start[1] + magnitude);
                }
            }
            // The counter names the quarter fringe from the comparators that have switched.
            const auto switched = distance[0][0] > zero;
            const V interval_s = (seen[1][0] - seen[0][0]) * tick_s;
            const V least_s = hn::Set(d, 2.0) * scale[1] * hn::Sqrt(least + least);
            const auto usable = hn::And(switched, hn::And(distance[1][0] > zero, interval_s > least_s));
            const V counted = hn::IfThenElse(switched, floor, floor + one);

            // Sampling: half-way between the nearest pulses that were distinguished, t_b and t_a, but for the
            // hysteresis, for which t_a^2 - t_b^2 is 4 h/a with times from the zero-rate point; these are proportional
            // to 1/sqrt(a), and sqrt(a) to the half cycle's angular frequency.
            const V last = hn::IfThenElse(usable, seen[0][0], seen[0][1]);
            const V first = hn::IfThenElse(usable, seen[1][0], seen[1][1]);
            const V share = before.w / (before.w + after.w);
            const V apart = (first - last) * tick_s;
            const V skew_s = (hysteresis + hysteresis) * scale[1] * scale[1] / apart;
            const V middle = sm::fnma(d, skew_s, clock, sm::fma(d, share, last, (one - share) * first));
            const V latch = electronics.ideal ? t0 : clocked ? hn::Floor(middle) : middle;
            const V off_s = (clocked ? (latch - tick_fraction) * tick_s : latch) - t0;
            const V side_scale = hn::IfThenElse(off_s < zero, scale[0], scale[1]);
            const V beyond = sm::fma(d, half, off_s * off_s, blunting) / (side_scale * side_scale);
            V sine = true_sine;
            V cosine = true_cosine;
            V error = zero;  // phase read less phase, fringes
            if (!electronics.ideal) {
                V turn_s, turn_c;
                gm::sincos_small(d, sign * beyond, turn_s, turn_c);
                const V at_sine = sm::fma(d, true_sine, turn_c, true_cosine * turn_s);
                const V at_cosine = sm::fnma(d, true_sine, turn_s, true_cosine * turn_c);
                sine = sm::fma(d, at_sine, load(constants.gain), load(constants.offset_sin));
                cosine =
                    sm::fnma(d, at_sine, load(constants.orthogonality_sine),
                             sm::fma(d, at_cosine, load(constants.orthogonality_cosine), load(constants.offset_cos)));
                if (!noise.detectors.empty()) {
                    sine = sm::fma(d, detector_rms, load(noise.detectors[2 * i]), sine);
                    cosine = sm::fma(d, detector_rms, load(noise.detectors[2 * i + 1]), cosine);
                }
                sine = converted(d, sine, steps);
                cosine = converted(d, cosine, steps);
                error = sm::arg(d, sm::fma(d, cosine, true_cosine, sine * true_sine),
                                sm::fnma(d, cosine, true_sine, sine * true_cosine)) *
                        per_rad;
            }
            const V named = sign * (counted + half) * quarter;  // middle of the quarter fringe
            if (!electronics.ideal) error = sm::fraction(d, phase + error - named) + (named - phase);
            store(sine, readings.sine[i]);
            store(cosine, readings.cosine[i]);
            if (!readings.zero_rate_s.empty()) {
                store(off_s + t0, readings.zero_rate_s[i]);
                store(sm::fma(d, sign, counted + half, hn::Neg(half)), readings.count[i]);
            }
            V read_fringes = phase + error;
            V output_error = electronics.interpolate ? error : named - phase;
            V first_quarter = floor + one;
            if (!noise.count_errors.empty()) {
                const V off = quarter * load(noise.count_errors[i]);
                const V branch = sm::nearest(d, off - (phase + error - named));
                read_fringes = read_fringes + branch;
                output_error = output_error + (electronics.interpolate ? branch : off);
                // The comparator that switched, and its direction, determine the number of the quarter modulo 4, which
                // therefore moves along.
                first_quarter = sm::fma(d, sign * branch, hn::Set(d, 4.0), first_quarter);
            }
            store(read_fringes, readings.phase_fringes[i]);
            const V swing = drive.direction(i) > 0 ? zero : load(constants.swing_whole);
            store(load(drive.rotation_whole[i]) + lockin_whole + swing, readings.phase_whole[i]);
            store(load(drive.rotation_fringes[i]) + lockin + output_error, angles.angle_fringes[i]);
            store(load(drive.rotation_whole[i]) + lockin_whole, angles.angle_whole[i]);

            LanePulses& pulses = readings.pulses;
            store(first_quarter, pulses.first_quarter[i]);
            for (std::size_t side = 0; side < 2; ++side) {
                for (std::size_t pulse = 0; pulse < kept_pulses; ++pulse) {
                    V time_s = (seen[side][pulse] - latch) * tick_s;
                    if (pulse == 0) time_s = hn::IfThenElseZero(usable, time_s);
                    store(time_s, pulses.time_s[side][pulse][i]);
                }
            }
            if (electronics.ideal) {
                store(drive_acceleration<extras>(d, before, extra, t0), readings.accel_before_rad_s2[i]);
                store(drive_acceleration<extras>(d, after, extra, t0), readings.accel_after_rad_s2[i]);
                continue;
            }
            // Accelerations from the two nearest pulses that were distinguished, by the distances that the phase read
            // and the hysteresis give.
            const V read = sm::fnma(d, sign * error, hn::Set(d, 6.283185307179586), near);
            V roots[3];
            for (std::size_t side = 0; side < 2; ++side) {
                for (std::size_t pulse = 0; pulse < 3; ++pulse) {
                    const V at = sm::fma(d, hn::Set(d, static_cast<double>(pulse)), quarter_rad, read) +
                                 (side == 0 ? hn::Neg(hysteresis) : hysteresis);
                    roots[pulse] = hn::Sqrt(hn::Max(at + at, zero));
                }
                const V* of = seen[side];
                const V near_interval = hn::Abs(of[1] - of[0]) * tick_s;
                const V far_interval = hn::Abs(of[2] - of[1]) * tick_s;
                store(acceleration_of(d, hn::IfThenElse(usable, roots[0], roots[1]),
                                      hn::IfThenElse(usable, roots[1], roots[2]),
                                      hn::IfThenElse(usable, near_interval, far_interval)),
                      (side == 0 ? readings.accel_before_rad_s2 : readings.accel_after_rad_s2)[i]);
            }
        }
    }
    return true;
}

bool read_lanes(const ReadoutConstants& constants, std::span<const PulseTables> tables, const Electronics& electronics,
                std::size_t lanes, const gyro::LaneDrive& drive, const gyro::LaneTurns& turns,
                const ElectronicNoise& noise, LaneReadings& readings, LaneAngles& angles) {
    const auto read = constants.extras ? read_all<true> : read_all<false>;
    return read(constants, tables, electronics, lanes, drive, turns, noise, readings, angles);
}

}  // namespace ringlock::readout::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::readout {

HWY_EXPORT(read_lanes);

double low_pass_s(const Electronics& electronics) {
    if (electronics.ideal || electronics.detector_bandwidth_hz == 0.0) return 0.0;
    return 1.0 / (units::two_pi * electronics.detector_bandwidth_hz);
}

double least_distance_rad(const Electronics& electronics) {
    if (electronics.ideal) return 0.0;
    return 6.0 * electronics.comparator_noise_relative;
}

bool read_pulse_by_pulse(const ReadoutConstants& constants, std::span<const PulseTables> tables,
                         const Electronics& electronics, std::size_t lanes, const gyro::LaneDrive& drive,
                         const gyro::LaneTurns& turns, const ElectronicNoise& noise, LaneReadings& readings,
                         LaneAngles& angles) {
    readings.pulses.resize(drive.turns);
    return HWY_DYNAMIC_DISPATCH(read_lanes)(constants, tables, electronics, lanes, drive, turns, noise, readings,
                                            angles);
}

}  // namespace ringlock::readout
#endif
