#include "engine/dither/lane_dither.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/dither/lane_dither.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::dither::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

/// `deviates`: of the turns after each turn of the piece; null: no noise.
void fill(const LaneDither::Constants& constants, double noise_rms_rad, const simd::Lanes* deviates,
          std::span<const simd::Lanes> angle_arcsec, std::span<const simd::Lanes> threshold_factor,
          std::span<const simd::Lanes> coupling_phase_rad, std::size_t lanes, LaneDither::State& state,
          gyro::LaneDrive& drive) {
    const D d;
    const V rms = hn::Set(d, noise_rms_rad);
    const V per_rad = hn::Set(d, 0.15915494309189535);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        V rotation = load(state.rotation_fringes);
        V whole = load(state.rotation_whole);
        V noise = load(state.noise_rad);
        V rate = load(state.rate_rad_s);
        V b = load(state.b_rad_s);
        const V amplitude = load(constants.amplitude_rad);
        V swing = load(state.amplitude_rad);
        store(swing, drive.amplitude_rad[0]);
        store(rate, drive.rate_rad_s[0]);
        store(b, drive.b_rad_s[0]);
        for (std::size_t i = 0; i < drive.turns; ++i) {
            const int direction = drive.direction(i);
            const std::size_t side = direction > 0 ? 0 : 1;
            store(rotation, drive.rotation_fringes[i]);
            store(whole, drive.rotation_whole[i]);
            store(sm::fma(d, noise, per_rad, rotation + load(constants.start_fringes[side])), drive.plain_fringes[i]);
            const V next = deviates != nullptr ? rms * load(deviates[i]) : hn::Zero(d);
            swing = sm::fma(d, hn::Set(d, 0.5 * direction), next - noise, amplitude);
            store(swing, drive.amplitude_rad[i + 1]);
            V added = load(constants.turn_fringes[side]);
            V added_whole = load(constants.turn_whole[side]);
            if (!angle_arcsec.empty()) {
                const V angle = load(angle_arcsec[i]);
                rate = sm::fma(d, angle, load(constants.rate_per_arcsec[side]), load(constants.input_rate_rad_s));
                const V fringes = angle * load(constants.fringes_per_arcsec);
                const V nearest = sm::nearest(d, fringes);
                added = added + (fringes - nearest);
                added_whole = added_whole + nearest;
            }
            if (!threshold_factor.empty()) b = load(threshold_factor[i]) * load(constants.b_rad_s);
            if (!drive.constants_filled) {
                store(rate, drive.rate_rad_s[i + 1]);
                store(b, drive.b_rad_s[i + 1]);
            }
            rotation = rotation + added;
            const V carry = sm::nearest(d, rotation);
            rotation = rotation - carry;
            whole = whole + added_whole + carry;
            noise = next;
        }
        store(rotation, state.rotation_fringes);
        store(whole, state.rotation_whole);
        store(noise, state.noise_rad);
        store(swing, state.amplitude_rad);
        store(rate, state.rate_rad_s);
        store(b, state.b_rad_s);
        if (!drive.phases_vary) continue;
        V phase = load(state.coupling_phase_fringes);
        store(phase, drive.coupling_phase_fringes[0]);
        for (std::size_t i = 0; i < drive.turns; ++i) {
            phase = sm::fma(d, load(coupling_phase_rad[i]), per_rad, load(constants.coupling_phase_fringes));
            store(phase, drive.coupling_phase_fringes[i + 1]);
        }
        store(phase, state.coupling_phase_fringes);
    }
}

}  // namespace ringlock::dither::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::dither {

HWY_EXPORT(fill);

LaneDither::LaneDither(std::span<const gyro::Device> devices, double noise_rms_rad, const random::LaneIdentities& who,
                       const Wander& wander)
    : lanes_(devices.size()), noise_rms_rad_(noise_rms_rad), who_(who), wander_(wander) {
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        // Lanes without a gyro go through the motions of the last one.
        const gyro::Device& device = devices[std::min(lane, devices.size() - 1)];
        constants_.amplitude_rad[lane] = device.dither_amplitude_rad;
        constants_.input_rate_rad_s[lane] = device.input_rate_rad_s;
        constants_.b_rad_s[lane] = device.coupling.b_rad_s;
        constants_.coupling_phase_fringes[lane] = device.coupling.phase_rad / units::two_pi;
        constants_.fringes_per_arcsec[lane] = device.phase_per_arcsec / units::two_pi;
        const double start = device.initial_phase_rad / units::two_pi;
        const double peak = 2.0 * device.dither_amplitude_rad / units::two_pi;
        constants_.start_fringes[0][lane] = start;
        constants_.start_fringes[1][lane] = start + (peak - std::nearbyint(peak));
        for (const std::size_t side : {0U, 1U}) {
            const double duration_s = side == 0 ? device.positive_duration_s : device.negative_duration_s;
            const double turned = device.input_rate_rad_s * duration_s / units::two_pi;
            constants_.turn_whole[side][lane] = std::nearbyint(turned);
            constants_.turn_fringes[side][lane] = turned - std::nearbyint(turned);
            constants_.duration_s[side][lane] = duration_s;
            constants_.rate_per_arcsec[side][lane] = device.phase_per_arcsec / duration_s;
        }
    }
    simd::Lanes first;
    if (noise_rms_rad_ > 0.0) random::normals(who_, random::Purpose::noise_injection, 0, 1, lanes_, first.data());
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        state_.noise_rad[lane] = noise_rms_rad_ * first[lane];
        state_.amplitude_rad[lane] = constants_.amplitude_rad[lane] - 0.5 * state_.noise_rad[lane];
    }
    state_.rate_rad_s = constants_.input_rate_rad_s;
    state_.b_rad_s = constants_.b_rad_s;
    state_.coupling_phase_fringes = constants_.coupling_phase_fringes;
}

LaneDither::LaneDither(std::span<const gyro::Device> devices, const gyro::DriveNoise& noise, double noise_rms_rad,
                       const random::LaneIdentities& who, const Wander& wander)
    : LaneDither(devices, 0.0, who, wander) {
    if (noise_rms_rad <= 0.0) return;
    resonator_ = std::make_unique<DriveNoiseLanes>(noise, devices, noise_rms_rad, who);
    // A force that is constant over half cycles makes the amplitude grow evenly; one of many levels in each does not.
    amplitudes_change_ = noise.form != gyro::NoiseForm::white;
    before_rad_ = resonator_->before_rad();
    deviation_rad_.assign(1, resonator_->deviation_rad());
    late_s_.assign(1, resonator_->late_s());
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        state_.noise_rad[lane] = -deviation_rad_[0][lane];
        state_.amplitude_rad[lane] += 0.5 * (before_rad_[lane] + deviation_rad_[0][lane]);
    }
}

void LaneDither::take_drive_noise(std::size_t turns) {
    // Rows: the turns of the piece and the one after it.
    deviation_rad_.erase(deviation_rad_.begin(), deviation_rad_.end() - 1);
    late_s_.erase(late_s_.begin(), late_s_.end() - 1);
    std::vector<simd::Lanes> deviation_rad;
    std::vector<simd::Lanes> late_s;
    resonator_->next(turns, deviation_rad, late_s);
    deviation_rad_.insert(deviation_rad_.end(), deviation_rad.begin(), deviation_rad.end());
    late_s_.insert(late_s_.end(), late_s.begin(), late_s.end());
    for (std::size_t i = 0; i < turns; ++i) {
        const double sign = (turn_ + static_cast<std::int64_t>(i) + 1) % 2 == 0 ? -1.0 : 1.0;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) deviates_[i][lane] = sign * deviation_rad_[i + 1][lane];
    }
}

void LaneDither::finish_drive(gyro::LaneDrive& drive) {
    // Rotation by the input during the delay of a late turn, at the rate of the half cycle that ends. Half cycles keep
    // their length; the rotation is added to their swings.
    for (std::size_t i = 0; i <= drive.turns; ++i) {
        for (std::size_t lane = 0; lane < lanes_; ++lane) {
            const double turned_fringes = drive.rate_rad_s[i][lane] * late_s_[i][lane] / units::two_pi;
            // Half cycle i has the sign of the turn before turn i.
            const double half_swing_rad = -0.5 * drive.direction(i) * units::two_pi;
            drive.amplitude_rad[i][lane] += half_swing_rad * (turned_fringes - turned_before_fringes_[lane]);
            if (i == drive.turns) continue;
            drive.plain_fringes[i][lane] += turned_fringes;
            turned_before_fringes_[lane] = turned_fringes;
        }
    }
    drive.late_s.assign(late_s_.begin(), late_s_.begin() + static_cast<std::ptrdiff_t>(drive.turns));
    if (!amplitudes_change_) return;
    for (std::size_t i = 0; i <= drive.turns; ++i) {
        const simd::Lanes& from = i == 0 ? before_rad_ : deviation_rad_[i - 1];
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            drive.amplitude_change_rad[i][lane] = deviation_rad_[i][lane] - from[lane];
        }
    }
}

void LaneDither::next(std::size_t turns, std::span<const simd::Lanes> extra_angle_arcsec,
                      std::span<const simd::Lanes> threshold_factor, gyro::LaneDrive& drive,
                      std::span<const simd::Lanes> coupling_phase_rad) {
    drive.phases_vary = !coupling_phase_rad.empty();
    drive.amplitudes_change = amplitudes_change_;
    drive.resize(turns);
    drive.first_turn = turn_;
    const bool vary = !extra_angle_arcsec.empty() || !threshold_factor.empty();
    drive.constants_filled = drive.constants_filled && !vary && filled_ == &drive;
    filled_ = vary ? nullptr : &drive;
    drive.rates_vary = !extra_angle_arcsec.empty();
    drive.thresholds_vary = !threshold_factor.empty();
    if (noise_rms_rad_ > 0.0 && turns > 0) {
        deviates_.resize(turns);
        random::normals(who_, random::Purpose::noise_injection, static_cast<std::uint64_t>(turn_) + 1, turns, lanes_,
                        deviates_.front().data());
    }
    if (resonator_ && turns > 0) {
        deviates_.resize(turns);
        take_drive_noise(turns);
    }
    if (wander_.active() && turns > 0) {
        deviates_.resize(turns);
        add_wander();
    }
    const bool moved = noise_rms_rad_ > 0.0 || resonator_ || wander_.active();
    HWY_DYNAMIC_DISPATCH(fill)
    (constants_, wander_.active() || resonator_ ? 1.0 : noise_rms_rad_, moved ? deviates_.data() : nullptr,
     extra_angle_arcsec, threshold_factor, coupling_phase_rad, lanes_, state_, drive);
    drive.constants_filled = !vary;
    if (resonator_ && turns > 0) {
        finish_drive(drive);
        before_rad_ = deviation_rad_[turns - 1];
    }
    turn_ += static_cast<std::int64_t>(turns);
}

void LaneDither::add_wander() {
    const std::size_t turns = deviates_.size();
    steps_.assign(turns, simd::Lanes{});
    if (wander_.relative_rt_s != 0.0) {
        random::normals(who_, random::Purpose::amplitude_wander, static_cast<std::uint64_t>(turn_), turns, lanes_,
                        steps_.front().data());
    }
    for (std::size_t i = 0; i < turns; ++i) {
        // Turn `number` ends a half cycle of positive sign where it is odd: a maximum.
        const std::int64_t number = turn_ + static_cast<std::int64_t>(i) + 1;
        const bool maximum = number % 2 != 0;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const auto& duration_s = constants_.duration_s;
            const double time_s = static_cast<double>(number / 2) * (duration_s[0][lane] + duration_s[1][lane]) +
                                  (maximum ? duration_s[0][lane] : 0.0);
            walk_[lane] += wander_.relative_rt_s * std::sqrt(duration_s[maximum ? 0 : 1][lane]) * steps_[i][lane];
            const double farther =
                constants_.amplitude_rad[lane] * (wander_.drift_relative_per_s * time_s + walk_[lane]);
            const double noise = resonator_             ? deviates_[i][lane]
                                 : noise_rms_rad_ > 0.0 ? noise_rms_rad_ * deviates_[i][lane]
                                                        : 0.0;
            deviates_[i][lane] = noise + (maximum ? farther : -farther);
        }
    }
}

}  // namespace ringlock::dither
#endif
