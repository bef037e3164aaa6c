#include "engine/compensate/adaptive.hpp"

#include <algorithm>
#include <cmath>

namespace ringlock::compensate {

namespace {

constexpr std::int64_t turns_between_estimates = 128;
constexpr double tables_share = 0.01;    // of the coupling, within which tables stay as they are
constexpr double coupling_share = 0.02;  // half width of the turn map's tables

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

}  // namespace

Adaptive::Adaptive(const Calibration& calibration, const readout::Electronics& electronics, double tolerance_rad)
    : lanes_(calibration.lanes),
      recovery_(devices_of(calibration), electronics, calibration.amplitude_rms_rad,
                calibration.amplitude_change_rms_rad),
      exact_(calibration, tolerance_rad, coupling_share) {
    recovery_.learn();
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
        filters_.emplace_back(recovery_.coupling_of_tables(lane));
        const double period_s = calibration.positive_duration_s[lane] + calibration.negative_duration_s[lane];
        between_estimates_s_.push_back(0.5 * period_s * turns_between_estimates);
    }
}

void Adaptive::take_coupling() {
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
        CouplingFilter& filter = filters_[lane];
        const auto tables = recovery_.coupling_of_tables(lane);
        if (filter.observe(recovery_.bends(lane), tables, turns_between_estimates, between_estimates_s_[lane])) {
            recovery_.forget_bends(lane);
        }
        const auto [b_rad_s, phase_rad] = filter.coupling();
        exact_.set_coupling(lane, b_rad_s, phase_rad);
        const double ratio = b_rad_s / tables.b_rad_s;
        const double moved = std::hypot(ratio * std::cos(phase_rad - tables.phase_rad) - 1.0,
                                        ratio * std::sin(phase_rad - tables.phase_rad));
        if (moved > tables_share) recovery_.set_coupling(lane, {b_rad_s, phase_rad});
    }
}

void Adaptive::observe(const readout::LaneReadings& readings, LaneErrors& errors) {
    recovered_ = readings;
    for (std::size_t row = 0; row < readings.turns;) {
        const std::int64_t left = turns_between_estimates - turns_ % turns_between_estimates;
        const std::size_t last = std::min(readings.turns, row + static_cast<std::size_t>(left));
        recovery_.recover(recovered_, row, last, nullptr);
        exact_.observe(recovered_, row, last, errors);
        turns_ += static_cast<std::int64_t>(last - row);
        row = last;
        if (turns_ % turns_between_estimates == 0) take_coupling();
    }
}

}  // namespace ringlock::compensate
