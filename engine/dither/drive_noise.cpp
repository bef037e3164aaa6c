#include "engine/dither/drive_noise.hpp"

#include <algorithm>
#include <boost/random/uniform_01.hpp>
#include <cmath>
#include <numbers>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/dither/drive_noise.cpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::dither::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

/// Advances state and loop from a nominal turn to the next. `level_rad`: level of the half cycle between, where it is
/// constant.
void advance_lanes(const gyro::Resonator& resonator, std::size_t lanes, const simd::Lanes* level_rad,
                   DriveNoiseLanes::State& state) {
    const D d;
    const V per_u[2] = {hn::Set(d, resonator.step()(0, 0)), hn::Set(d, resonator.step()(1, 0))};
    const V per_q[2] = {hn::Set(d, resonator.step()(0, 1)), hn::Set(d, resonator.step()(1, 1))};
    const V per_force[2] = {hn::Set(d, resonator.held_input()(0)), hn::Set(d, resonator.held_input()(1))};
    const V gain = hn::Set(d, resonator.loop_gain());
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const V u = load(state.u_rad);
        const V q = load(state.q_rad);
        const V loop = load(state.loop_rad);
        const V force = level_rad != nullptr ? loop + load(*level_rad) : loop;
        store(sm::fma(d, per_force[0], force, sm::fma(d, per_u[0], u, per_q[0] * q)), state.u_rad);
        store(sm::fma(d, per_force[1], force, sm::fma(d, per_u[1], u, per_q[1] * q)), state.q_rad);
        store(loop, state.ending_loop_rad);
        store(sm::fnma(d, gain, load(state.deviation_rad), loop), state.loop_rad);
    }
}

/// The turn next to the nominal one, under one force on either side: the zero of the velocity of
/// y'' + 2 damping y' + y = -2 damping force sin(angle), by its series in the angle, which is below 0.03.
void place_lanes(double damping, double per_rad_s, std::size_t lanes, const simd::Lanes* level_before_rad,
                 const simd::Lanes* level_after_rad, DriveNoiseLanes::State& state) {
    constexpr int order = 7;
    const D d;
    const V zero = hn::Zero(d);
    const V c = hn::Set(d, 2.0 * damping);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const V amplitude = load(state.amplitude_rad);
        const V v = load(state.q_rad) + load(state.forced_q_rad);
        const auto after = v > zero;
        V force = amplitude + hn::IfThenElse(after, load(state.loop_rad), load(state.ending_loop_rad));
        if (level_after_rad != nullptr) {
            force = force + hn::IfThenElse(after, load(*level_after_rad), load(*level_before_rad));
        }
        // In powers of the angle, n times the n-th coefficient of y: the velocity's.
        const V deviation = load(state.u_rad) + load(state.forced_u_rad);
        const V drive[order - 1] = {zero, hn::Neg(c * force),
                                    zero, c * force * hn::Set(d, 1.0 / 6.0),
                                    zero, hn::Neg(c * force) * hn::Set(d, 1.0 / 120.0)};
        V velocity[order + 1];
        velocity[1] = v;
        V last = amplitude + deviation;  // y's coefficient two before
        for (int n = 0; n + 2 <= order; ++n) {
            const V right = drive[n] - sm::fma(d, c, velocity[n + 1], last);
            velocity[n + 2] = right * hn::Set(d, 1.0 / (n + 1));
            last = velocity[n + 1] * hn::Set(d, 1.0 / (n + 1));
        }
        V x = zero;
        for (int i = 0; i < 3; ++i) {
            V rate = velocity[order];
            V slope = zero;
            for (int n = order - 1; n >= 1; --n) {
                slope = sm::fma(d, slope, x, rate);
                rate = sm::fma(d, rate, x, velocity[n]);
            }
            x = x - rate / slope;
        }
        V angle = velocity[order] * hn::Set(d, 1.0 / order);
        for (int n = order - 1; n >= 1; --n) angle = sm::fma(d, angle, x, velocity[n] * hn::Set(d, 1.0 / n));
        store(sm::fma(d, angle, x, deviation), state.deviation_rad);
        store(x * hn::Set(d, per_rad_s), state.late_s);
    }
}

}  // namespace ringlock::dither::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::dither {

HWY_EXPORT(advance_lanes);
HWY_EXPORT(place_lanes);

namespace {

using gyro::NoiseDistribution;
using gyro::NoiseForm;

/// A deviate of variance 1 of the distribution, from a standard normal one.
double shaped(double normal, NoiseDistribution distribution) {
    switch (distribution) {
        case NoiseDistribution::uniform:
            return std::numbers::sqrt3 * std::erf(normal / std::numbers::sqrt2);
        case NoiseDistribution::binary:
            return std::copysign(1.0, normal);
        case NoiseDistribution::gaussian:
            break;
    }
    return normal;
}

/// Upright motion of one case next to a nominal turn, its angle y and velocity y'/w = v, by the angle w t from there.
/// Without noise y = A cos(w t).
struct NearTurn {
    double damping;
    double angle_rad = 0.0;  ///< w t
    double y, v;

    double acceleration(double force) const {
        return -y - 2.0 * damping * v - 2.0 * damping * force * std::sin(angle_rad);
    }

    /// Goes on by a small angle, up to 0.1 either way, under a constant force (given as its stationary amplitude):
    /// Taylor series of y'' + 2 damping y' + y = -2 damping force sin(angle), whose coefficients are in powers of the
    /// step.
    void go(double step_rad, double force) {
        constexpr int order = 12;
        const double sine = std::sin(angle_rad);
        const double cosine = std::cos(angle_rad);
        double coefficient[order + 1] = {y, v};
        double factorial = 1.0;
        for (int n = 0; n + 2 <= order; ++n) {
            if (n > 0) factorial *= n;
            const double derivative = n % 4 == 0 ? sine : n % 4 == 1 ? cosine : n % 4 == 2 ? -sine : -cosine;
            const double drive = -2.0 * damping * force * derivative / factorial;
            coefficient[n + 2] = (drive - 2.0 * damping * (n + 1) * coefficient[n + 1] - coefficient[n]) /
                                 static_cast<double>((n + 1) * (n + 2));
        }
        double angle = 0.0;
        double rate = 0.0;
        for (int n = order; n >= 1; --n) {
            angle = angle * step_rad + coefficient[n];
            rate = rate * step_rad + n * coefficient[n];
        }
        y += angle * step_rad;
        v = rate;
        angle_rad += step_rad;
    }

    /// To the zero of the velocity within `room_rad` of here in its direction; false, and at the end of the room, where
    /// it lies beyond.
    bool find_turn(double room_rad, double force) {
        const NearTurn start = *this;
        // The velocity falls through zero where the angle is largest.
        double step = -v / acceleration(force);
        for (int i = 0; i < 6; ++i) {
            if (std::abs(step) > std::abs(room_rad) || step * room_rad < 0.0) {
                step = room_rad;
            }
            *this = start;
            go(step, force);
            const double correction = -v / acceleration(force);
            if (step == room_rad && correction * room_rad > 0.0) return false;
            step += correction;
            if (std::abs(correction) < 1e-15) break;
        }
        return true;
    }
};

}  // namespace

DriveNoiseLanes::DriveNoiseLanes(const gyro::DriveNoise& noise, std::span<const gyro::Device> devices, double rms_rad,
                                 const random::LaneIdentities& who)
    : noise_(noise), resonator_(noise), lanes_(devices.size()), who_(who) {
    if (resonator_.decay() >= 1.0) throw RunError("noise of a drive: its amplitude loop is not stable");
    level_rad_ = rms_rad / resonator_.rms();
    // The state at the beginning is forgotten before the run.
    first_turn_ = -2 - static_cast<std::int64_t>(std::ceil(resonator_.settling_half_cycles()));
    turn_ = first_turn_;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        state_.amplitude_rad[lane] = devices[std::min(lane, devices.size() - 1)].dither_amplitude_rad;
        auto engine = random::make_engine({who.seed, who.gyro[lane]}, random::Purpose::drive_noise_phase);
        const double share = boost::random::uniform_01<double>()(engine);
        hold_phase_[lane] = std::min(noise.hold_half_cycles - 1,
                                     static_cast<std::int64_t>(share * static_cast<double>(noise.hold_half_cycles)));
        modulation_phase_rad_[lane] = units::two_pi * share;
    }
    ending_ = levels_of(turn_ - 1);
    beginning_ = levels_of(turn_);
    place_turns();
    while (turn_ < 0) advance();
}

DriveNoiseLanes::Levels DriveNoiseLanes::levels_of(std::int64_t turn) const {
    Levels levels;
    if (noise_.form == NoiseForm::sinusoidal) return levels;
    const auto half_cycle = static_cast<std::uint64_t>(turn - first_turn_ + 1);
    const std::uint64_t each = noise_.form == NoiseForm::white ? gyro::white_levels : 1;
    levels.rad.resize(each);
    if (noise_.form == NoiseForm::white) {
        random::normals(who_, random::Purpose::drive_noise, half_cycle * each, each, lanes_, levels.rad.front().data());
    } else {
        for (std::size_t lane = 0; lane < lanes_; ++lane) {
            // A hold's level has the number of the hold; gyros hold in phases of their own.
            const std::uint64_t number = (half_cycle + static_cast<std::uint64_t>(hold_phase_[lane])) /
                                         static_cast<std::uint64_t>(noise_.hold_half_cycles);
            levels.rad[0][lane] = random::normal({who_.seed, who_.gyro[lane]}, random::Purpose::drive_noise, number);
        }
    }
    for (simd::Lanes& row : levels.rad) {
        for (std::size_t lane = 0; lane < lanes_; ++lane)
            row[lane] = level_rad_ * shaped(row[lane], noise_.distribution);
    }
    return levels;
}

void DriveNoiseLanes::levels_after(const Levels& last, std::int64_t turn, Levels& levels) {
    if (noise_.form != NoiseForm::held) {
        levels = levels_of(turn);
        return;
    }
    levels.rad.resize(1);
    const auto half_cycle = static_cast<std::uint64_t>(turn - first_turn_ + 1);
    if (noise_.hold_half_cycles > 1) {
        for (std::size_t lane = 0; lane < lanes_; ++lane) {
            const auto number = half_cycle + static_cast<std::uint64_t>(hold_phase_[lane]);
            const auto hold = static_cast<std::uint64_t>(noise_.hold_half_cycles);
            levels.rad[0][lane] = number % hold != 0
                                      ? last.rad[0][lane]
                                      : level_rad_ * shaped(random::normal({who_.seed, who_.gyro[lane]},
                                                                           random::Purpose::drive_noise, number / hold),
                                                            noise_.distribution);
        }
        return;
    }
    if (half_cycle < drawn_from_ || half_cycle >= drawn_from_ + drawn_.size()) {
        constexpr std::size_t together = 64;
        drawn_from_ = half_cycle;
        drawn_.resize(together);
        random::normals(who_, random::Purpose::drive_noise, half_cycle, together, lanes_, drawn_.front().data());
    }
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
        levels.rad[0][lane] = level_rad_ * shaped(drawn_[half_cycle - drawn_from_][lane], noise_.distribution);
    }
}

std::vector<double> DriveNoiseLanes::levels_rad(std::size_t lane, std::int64_t turn) const {
    std::vector<double> levels;
    for (const simd::Lanes& row : levels_of(turn).rad) levels.push_back(row[lane]);
    return levels;
}

void DriveNoiseLanes::advance() {
    const simd::Lanes* level = noise_.form == NoiseForm::held ? beginning_.rad.data() : nullptr;
    HWY_DYNAMIC_DISPATCH(advance_lanes)(resonator_, lanes_, level, state_);
    if (noise_.form == NoiseForm::white) {
        for (std::size_t i = 0; i < gyro::white_levels; ++i) {
            const Eigen::Vector2d& input = resonator_.white_inputs()[i];
            for (std::size_t lane = 0; lane < lanes_; ++lane) {
                state_.u_rad[lane] += input(0) * beginning_.rad[i][lane];
                state_.q_rad[lane] += input(1) * beginning_.rad[i][lane];
            }
        }
    }
    ++turn_;
    std::swap(ending_, beginning_);
    levels_after(ending_, turn_, beginning_);
    place_turns();
}

void DriveNoiseLanes::place_turns() {
    const double per_rad_s = 1.0 / (units::two_pi * noise_.frequency_hz);
    before_rad_ = state_.deviation_rad;
    if (noise_.form == NoiseForm::white) return place_turns_among_levels(per_rad_s);
    if (noise_.form == NoiseForm::sinusoidal) {
        const gyro::Resonator::Response& of = resonator_.response();
        const double level_rad = std::numbers::sqrt2 * level_rad_;
        const double turned_rad = std::remainder(
            units::pi * noise_.modulation_hz / noise_.frequency_hz * static_cast<double>(turn_), units::two_pi);
        for (std::size_t lane = 0; lane < lanes_; ++lane) {
            const double phase = turned_rad + modulation_phase_rad_[lane];
            state_.forced_u_rad[lane] = level_rad * of.u * std::sin(phase - of.u_lag_rad);
            state_.forced_q_rad[lane] = level_rad * of.q * std::sin(phase - of.q_lag_rad);
        }
    }
    const bool held = noise_.form == NoiseForm::held;
    HWY_DYNAMIC_DISPATCH(place_lanes)
    (resonator_.damping(), per_rad_s, lanes_, held ? ending_.rad.data() : nullptr,
     held ? beginning_.rad.data() : nullptr, state_);
}

void DriveNoiseLanes::place_turns_among_levels(double per_rad_s) {
    constexpr double part_rad = units::pi / gyro::white_levels;
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
        const double a = state_.amplitude_rad[lane];
        NearTurn near{.damping = resonator_.damping(), .y = a + state_.u_rad[lane], .v = state_.q_rad[lane]};
        const bool after = near.v > 0.0;
        const double loop = after ? state_.loop_rad[lane] : state_.ending_loop_rad[lane];
        const Levels& levels = after ? beginning_ : ending_;
        for (int part = 0; part < gyro::white_levels / 4; ++part) {
            const auto row = static_cast<std::size_t>(after ? part : gyro::white_levels - 1 - part);
            if (near.find_turn(after ? part_rad : -part_rad, a + loop + levels.rad[row][lane])) break;
        }
        state_.deviation_rad[lane] = near.y - a;
        state_.late_s[lane] = near.angle_rad * per_rad_s;
    }
}

void DriveNoiseLanes::next(std::size_t turns, std::vector<simd::Lanes>& deviation_rad,
                           std::vector<simd::Lanes>& late_s) {
    deviation_rad.resize(turns);
    late_s.resize(turns);
    for (std::size_t i = 0; i < turns; ++i) {
        advance();
        deviation_rad[i] = state_.deviation_rad;
        late_s[i] = state_.late_s;
    }
}

}  // namespace ringlock::dither
#endif
