#include "engine/readout/lane_readout.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/readout/lane_readout.cpp"
#include "engine/core/error.hpp"
#include "engine/readout/pulse_readout.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/readout/pulse_tables-inl.hpp"
#include "engine/readout/zero_rate-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::readout::HWY_NAMESPACE {

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

/// Results for a turn so far.
struct Found {
    Walk walk;
    V quarters;  ///< phase at the zero-rate point in quarter fringes
    V error;     ///< phase read less phase, fringes
};

constexpr std::size_t turns_together = 16;

template <bool extras>
bool read_all(const ReadoutConstants& constants, std::span<const PulseTables> pulses, const Electronics& electronics,
              bool accelerations, std::size_t lanes, const gyro::LaneDrive& drive, const gyro::LaneTurns& turns,
              const ElectronicNoise& noise, std::size_t stride, LaneReadings& readings, LaneAngles& angles) {
    const D d;
    const V zero = hn::Zero(d);
    const V per_rad = hn::Set(d, 0.15915494309189535);
    const V quarter = hn::Set(d, 0.25);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const CouplingPhase own{load(constants.coupling_sine), load(constants.coupling_cosine)};
        const V lockin_whole = load(turns.lockin_whole);
        store(lockin_whole, angles.lockin_whole);
        const auto sides_of = [&](std::size_t i) HWY_ATTR { return sides_at<extras>(d, constants, drive, i, lane); };
        V last_scale = zero;
        // A few turns at a time, step by step: the operations of one turn depend on each other, those of different
        // turns do not, and short steps let the processor work at several turns in parallel.
        Found found[turns_together];
        for (std::size_t first = 0; first < drive.turns; first += turns_together * stride) {
            const std::size_t end = std::min(drive.turns, first + turns_together * stride);
            for (std::size_t i = first; i < end; i += stride) {
                const Sides sides = sides_of(i);
                Walk& walk = found[(i - first) / stride].walk;
                walk = {zero, sides.sign * load(turns.sine[i]), load(turns.cosine[i]), zero, zero};
                const Jump jump = jump_at(d, drive, i, lane);
                if (!walk_to_zero_rate<extras>(d, sides.before, sides.after, sides.extra, jump, walk)) return false;
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
                if (!angles.phase_fringes.empty()) {
                    store(phase, angles.phase_fringes[i]);
                    store(walk.time_s, angles.zero_rate_s[i]);
                }
                const CouplingPhase coupling = coupling_phase_at(d, own, drive, i, lane, walk.time_s);
                const V true_sine = sm::fnma(d, walk.cosine, coupling.sine, sign * walk.sine * coupling.cosine);
                const V true_cosine = sm::fma(d, sign * walk.sine, coupling.sine, walk.cosine * coupling.cosine);

                V sine = true_sine;
                V cosine = true_cosine;
                V error = zero;  // phase read less phase, fringes
                if (!electronics.ideal) {
                    sine = sm::fma(d, sine, load(constants.gain), load(constants.offset_sin));
                    cosine = sm::fnma(
                        d, true_sine, load(constants.orthogonality_sine),
                        sm::fma(d, true_cosine, load(constants.orthogonality_cosine), load(constants.offset_cos)));
                    if (!noise.detectors.empty()) {
                        const V rms = hn::Set(d, electronics.detector_noise_relative);
                        sine = sm::fma(d, rms, load(noise.detectors[2 * i]), sine);
                        cosine = sm::fma(d, rms, load(noise.detectors[2 * i + 1]), cosine);
                    }
                    error = sm::arg(d, sm::fma(d, cosine, true_cosine, sine * true_sine),
                                    sm::fnma(d, cosine, true_sine, sine * true_cosine)) *
                            per_rad;
                }
                // The counter names the quarter fringe; the quadrature's phase is taken on the branch nearest its
                // middle.
                const V quarters = phase * hn::Set(d, 4.0);
                const V in_quarter = (quarters - hn::Floor(quarters) - hn::Set(d, 0.5)) * quarter;
                if (!electronics.ideal) error = sm::fraction(d, in_quarter + error) - in_quarter;
                store(sine, readings.sine[i]);
                store(cosine, readings.cosine[i]);
                V read = phase + error;
                V output_error = electronics.interpolate ? error : hn::Neg(in_quarter);
                if (!noise.count_errors.empty()) {
                    const V off = quarter * load(noise.count_errors[i]);
                    const V branch = sm::nearest(d, off - (in_quarter + error));
                    read = read + branch;
                    output_error = output_error + (electronics.interpolate ? branch : off);
                }
                store(read, readings.phase_fringes[i]);
                const V swing = direction > 0 ? zero : load(constants.swing_whole);
                store(load(drive.rotation_whole[i]) + lockin_whole + swing, readings.phase_whole[i]);
                store(load(drive.rotation_fringes[i]) + lockin + output_error, angles.angle_fringes[i]);
                store(load(drive.rotation_whole[i]) + lockin_whole, angles.angle_whole[i]);
                found[(i - first) / stride].quarters = quarters;
                found[(i - first) / stride].error = error;
            }
            if (!accelerations) continue;
            for (std::size_t i = first; i < end; i += stride) {
                const auto& [sign, before, after, extra, after_side, growth] = sides_of(i);
                const auto& [walk, quarters, error] = found[(i - first) / stride];
                const bool timed = !readings.zero_rate_s.empty();
                if (timed) {
                    store(hn::Floor(quarters), readings.count[i]);
                    store(walk.time_s, readings.zero_rate_s[i]);
                }
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
                const PhaseWeights<V> weights = phase_weights(d, constants, drive, i, lane);
                const auto factors = pulse_factors<2>(d, pulses, after_side, lane, quarter_of(d, floor), x, weights);
                const V turned_s = walk.time_s;
                V nearest_s[2];
                const auto side_acceleration = [&](std::size_t which, const Side& side, V scale) HWY_ATTR {
                    const V curve = side.w * side.w * scale * scale;
                    const V near_factor = factors.values[which][0] + sinusoid_factor(d, curve * near);
                    const V far_factor = factors.values[which][1] + sinusoid_factor(d, curve * far);
                    const V first_s = sm::fma(d, near_root * scale, near_factor, turned_s);
                    nearest_s[which] = first_s;
                    const V second_s = sm::fma(d, far_root * scale, far_factor, turned_s);
                    const V interval = ticked_interval(d, tick_fraction, first_s, second_s, electronics.clock_hz);
                    return acceleration_of_pulses(d, measured_roots, interval);
                };
                // The half cycle after this turn is the one before the next, unless its two ends differ.
                const V scale_before =
                    extras || i == 0 || stride != 1 ? inverse_root_acceleration<extras>(d, before, extra) : last_scale;
                const V scale_after = inverse_root_acceleration<extras>(d, after, extra);
                last_scale = scale_after;
                store(side_acceleration(0, before, hn::Neg(scale_before)), readings.accel_before_rad_s2[i]);
                store(side_acceleration(1, after, scale_after), readings.accel_after_rad_s2[i]);
                if (timed) {
                    // Half-way between the nearest pulses on either side, in whole ticks; weighed as half cycles last,
                    // with the root of the acceleration, where they differ (docs/dev/readout.md).
                    const V after_s = load(constants.duration_s[after_side]);
                    const V before_s = load(constants.duration_s[1 - after_side]);
                    const V weight = after_s / (after_s + before_s);
                    V middle = sm::fma(d, weight, nearest_s[0] - nearest_s[1], nearest_s[1]);
                    if (electronics.clock_hz > 0.0) {
                        const V clock = hn::Set(d, electronics.clock_hz);
                        const V tick_before = hn::Floor(sm::fma(d, nearest_s[0], clock, tick_fraction));
                        const V tick_after = hn::Floor(sm::fma(d, nearest_s[1], clock, tick_fraction));
                        middle = (hn::Floor(sm::fma(d, weight, tick_before - tick_after, tick_after)) - tick_fraction) *
                                 hn::Set(d, 1.0 / electronics.clock_hz);
                    }
                    store(middle, readings.zero_rate_s[i]);
                }
            }
        }
    }
    return true;
}

bool read_lanes(const ReadoutConstants& constants, std::span<const PulseTables> pulses, const Electronics& electronics,
                bool accelerations, std::size_t lanes, const gyro::LaneDrive& drive, const gyro::LaneTurns& turns,
                const ElectronicNoise& noise, std::size_t stride, LaneReadings& readings, LaneAngles& angles) {
    const auto read = constants.extras ? read_all<true> : read_all<false>;
    return read(constants, pulses, electronics, accelerations, lanes, drive, turns, noise, stride, readings, angles);
}

}  // namespace ringlock::readout::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::readout {

HWY_EXPORT(read_lanes);

LaneReadout::LaneReadout(std::span<const gyro::Device> devices, std::span<const gyro::Ellipse> ellipses,
                         const Electronics& electronics, Wanted wanted, bool phases_vary)
    : lanes_(devices.size()),
      electronics_(electronics),
      wanted_(wanted),
      constants_(make_readout_constants(devices, ellipses)) {
    if (wanted == Wanted::phase || (wanted == Wanted::accelerations && electronics.ideal)) return;
    pulses_.resize(phases_vary ? PulseTables::phases : 1);
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        gyro::Device device = devices[std::min(lane, devices.size() - 1)];
        const double own_rad = device.coupling.phase_rad;
        for (std::size_t phase = 0; phase < pulses_.size(); ++phase) {
            const double beyond_rad = units::two_pi * static_cast<double>(phase) / PulseTables::phases;
            device.coupling = device.coupling.moved_to(own_rad + beyond_rad);
            pulses_[phase].make(lane, device, wanted == Wanted::pulses ? kept_pulses : 2);
        }
    }
}

void LaneReadout::read(const gyro::LaneDrive& drive, const gyro::LaneTurns& turns, const ElectronicNoise& noise,
                       std::size_t stride, LaneReadings& readings, LaneAngles& angles) const {
    readings.first_turn = drive.first_turn;
    readings.resize(drive.turns);
    angles.resize(drive.turns);
    if (times_) {
        readings.zero_rate_s.resize(drive.turns);
        readings.count.resize(drive.turns);
    }
    if (truth_) {
        angles.phase_fringes.resize(drive.turns);
        angles.zero_rate_s.resize(drive.turns);
    }
    const bool reversed =
        wanted_ == Wanted::pulses
            ? read_pulse_by_pulse(constants_, pulses_, electronics_, lanes_, drive, turns, noise, readings, angles)
            : HWY_DYNAMIC_DISPATCH(read_lanes)(constants_, pulses_, electronics_, wanted_ == Wanted::accelerations,
                                               lanes_, drive, turns, noise, stride, readings, angles);
    if (!reversed) {
        throw RunError(
            "readout: the phase does not reverse near a turn of the dither; the input rate is too high for it");
    }
}

}  // namespace ringlock::readout
#endif
