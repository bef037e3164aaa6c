#include "engine/compensate/adaptive.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ringlock::compensate {

namespace {

constexpr std::int64_t turns_between_estimates = 128;
constexpr double tables_share = 0.01;    // of the coupling, within which tables stay as they are
constexpr double coupling_share = 0.02;  // half width of the turn map's tables
constexpr double margin_sigmas = 8.0;    // of the half cycles' amplitudes, dither::LaneDither::amplitude_margin_rad()

std::vector<gyro::Device> devices_of(const Calibration& calibration) {
    std::vector<gyro::Device> devices;
    for (std::size_t lane = 0; lane < calibration.lanes; ++lane) {
        gyro::Device& device = devices.emplace_back(gyro::Setup{});
        device.coupling = {calibration.b_rad_s[lane], 0.0};
        device.dither_amplitude_rad = calibration.dither_amplitude_rad[lane];
        device.positive_duration_s = calibration.positive_duration_s[lane];
        device.negative_duration_s = calibration.negative_duration_s[lane];
    }
    return devices;
}

void copy_rows(const readout::LaneReadings& from, std::size_t first, std::size_t rows, readout::LaneReadings& to) {
    to.first_turn = from.first_turn + static_cast<std::int64_t>(first);
    to.resize(rows);
    to.pulses.resize(rows);
    const auto copy = [&](const std::vector<simd::Lanes>& source, std::vector<simd::Lanes>& target) {
        std::copy_n(source.begin() + static_cast<std::ptrdiff_t>(first), rows, target.begin());
    };
    copy(from.sine, to.sine);
    copy(from.cosine, to.cosine);
    copy(from.phase_fringes, to.phase_fringes);
    copy(from.phase_whole, to.phase_whole);
    copy(from.accel_before_rad_s2, to.accel_before_rad_s2);
    copy(from.accel_after_rad_s2, to.accel_after_rad_s2);
    copy(from.pulses.first_quarter, to.pulses.first_quarter);
    for (std::size_t number = 0; number < 4 && !from.pulses.known_shift_rad[0].empty(); ++number) {
        to.pulses.known_shift_rad[number].resize(rows);
        copy(from.pulses.known_shift_rad[number], to.pulses.known_shift_rad[number]);
    }
    for (std::size_t side = 0; side < 2; ++side) {
        for (std::size_t pulse = 0; pulse < readout::kept_pulses; ++pulse) {
            copy(from.pulses.time_s[side][pulse], to.pulses.time_s[side][pulse]);
        }
    }
}

}  // namespace

Adaptive::Adaptive(const Calibration& calibration, const readout::Electronics& electronics, double tolerance_rad)
    : lanes_(calibration.lanes),
      recovery_(devices_of(calibration), electronics, calibration.amplitude_margin_rad / margin_sigmas),
      exact_(calibration, tolerance_rad, coupling_share) {
    recovery_.learn(memory_turns);
    for (std::size_t lane = 0; lane < lanes_; ++lane) coupling_[lane] = recovery_.coupling(lane);
}

void Adaptive::take_coupling() {
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
        recovery_.retell(lane, tables_share);
        const auto mean = recovery_.coupling(lane);
        const double cosine = mean.b_rad_s * std::cos(mean.phase_rad);
        const double sine = mean.b_rad_s * std::sin(mean.phase_rad);
        const double share =
            static_cast<double>(turns_between_estimates) / std::min(static_cast<double>(turns_), memory_turns);
        late_cosine_[lane] += share * (cosine - late_cosine_[lane]);
        late_sine_[lane] += share * (sine - late_sine_[lane]);
        const double now_cosine = 2.0 * cosine - late_cosine_[lane];
        const double now_sine = 2.0 * sine - late_sine_[lane];
        coupling_[lane] = {std::hypot(now_cosine, now_sine), std::atan2(now_sine, now_cosine)};
        exact_.set_coupling(lane, coupling_[lane].b_rad_s, coupling_[lane].phase_rad);
    }
}

void Adaptive::observe(const readout::LaneReadings& readings, LaneErrors& errors) {
    errors.fringes.resize(readings.turns);
    for (std::size_t row = 0; row < readings.turns;) {
        const std::int64_t left = turns_between_estimates - turns_ % turns_between_estimates;
        const std::size_t rows = std::min(readings.turns - row, static_cast<std::size_t>(left));
        copy_rows(readings, row, rows, part_);
        recovery_.recover(part_, nullptr);
        exact_.observe(part_, part_errors_);
        if (row == 0) errors.whole = part_errors_.whole;
        for (std::size_t i = 0; i < rows; ++i) {
            for (std::size_t lane = 0; lane < lanes_; ++lane) {
                errors.fringes[row + i][lane] =
                    part_errors_.fringes[i][lane] + (part_errors_.whole[lane] - errors.whole[lane]);
            }
        }
        row += rows;
        turns_ += static_cast<std::int64_t>(rows);
        if (turns_ % turns_between_estimates == 0) take_coupling();
    }
}

}  // namespace ringlock::compensate
