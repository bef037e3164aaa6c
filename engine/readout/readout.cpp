#include "engine/readout/readout.hpp"

#include <cmath>

namespace ringlock::readout {

namespace {
constexpr double quarter_rad = 0.5 * units::pi;
}

Readout::Readout(const Electronics& electronics, const gyro::Ellipse& ellipse, random::Identity who)
    : electronics_(electronics), ellipse_(ellipse) {
    if (!electronics_.ideal && electronics_.detector_noise_relative > 0.0) {
        noise_.emplace(who, random::Purpose::detector_noise);
    }
}

ReadTurn Readout::read(const TurnPath& path, const Phase& phase, std::int64_t turn, double turn_time_s, int direction) {
    Phase truth;
    truth.fringes = phase.fringes;
    truth.add(path.zero_rate_phase_rad());
    const double psi = truth.remainder_rad;

    ReadTurn result;
    Reading& reading = result.reading;
    reading.direction = direction;
    reading.time_s = tick(turn_time_s, path.zero_rate_time_s());
    reading.quarter_count = 4 * truth.fringes + static_cast<std::int64_t>(std::floor(psi / quarter_rad));
    reading.sin = std::sin(psi);
    reading.cos = std::cos(psi);
    if (!electronics_.ideal) {
        const gyro::Ellipse& e = ellipse_;
        reading.sin = (1.0 + e.gain) * reading.sin + e.offset_sin;
        reading.cos = std::cos(psi + e.orthogonality_rad) + e.offset_cos;
        if (noise_) {
            noise_->seek(static_cast<std::uint64_t>(turn));
            reading.sin += electronics_.detector_noise_relative * (*noise_)();
            reading.cos += electronics_.detector_noise_relative * (*noise_)();
        }
    }
    const Phase joined = joined_phase(reading);
    const double measured = static_cast<double>(joined.fringes - truth.fringes) * units::two_pi + joined.remainder_rad;
    if (electronics_.ideal) {
        reading.accel_before_rad_s2 = path.acceleration_rad_s2(-1);
        reading.accel_after_rad_s2 = path.acceleration_rad_s2(1);
    } else {
        reading.accel_before_rad_s2 = acceleration(path, -1, direction, measured, turn_time_s);
        reading.accel_after_rad_s2 = acceleration(path, 1, direction, measured, turn_time_s);
    }
    if (electronics_.interpolate) {
        result.phase_error_rad = measured - psi;
    } else {
        const std::int64_t in_fringe = reading.quarter_count - 4 * truth.fringes;
        result.phase_error_rad = (static_cast<double>(in_fringe) + 0.5) * quarter_rad - psi;
    }
    return result;
}

double Readout::acceleration(const TurnPath& path, int side, int direction, double measured_rad,
                             double turn_time_s) const {
    // The comparators switch at whole quarter fringes of the true phase; how far these are from the extremum the
    // electronics know only through the phase they measured.
    const double psi = std::remainder(path.zero_rate_phase_rad(), units::two_pi);
    const double first = direction > 0 ? (std::floor(psi / quarter_rad) + 1.0) * quarter_rad
                                       : (std::ceil(psi / quarter_rad) - 1.0) * quarter_rad;
    const double true_distance = direction * (first - psi);
    const auto times = path.crossing_times_s(side, {true_distance, true_distance + quarter_rad});
    const double interval = std::abs(tick(turn_time_s, times[1]) - tick(turn_time_s, times[0]));
    if (!(interval > 0.0)) return 0.0;
    // distance = a (t - t0)^2 / 2 at both pulses: two equations for a and t0.
    const double near = std::max(direction * (first - measured_rad), 0.0);
    const double far = std::max(direction * (first - measured_rad) + quarter_rad, 0.0);
    const double root = (std::sqrt(2.0 * far) - std::sqrt(2.0 * near)) / interval;
    return root * root;
}

double Readout::tick(double turn_time_s, double offset_s) const {
    if (electronics_.ideal || electronics_.clock_hz <= 0.0) return turn_time_s + offset_s;
    // Whole ticks since the start, split so that microseconds keep their digits after a month.
    const double ticks = turn_time_s * electronics_.clock_hz;
    const double whole = std::floor(ticks);
    return (whole + std::floor(ticks - whole + offset_s * electronics_.clock_hz)) / electronics_.clock_hz;
}

Phase joined_phase(const Reading& reading) {
    const std::int64_t fringe =
        reading.quarter_count >= 0 ? reading.quarter_count / 4 : -((3 - reading.quarter_count) / 4);
    const double middle = (static_cast<double>(reading.quarter_count - 4 * fringe) + 0.5) * quarter_rad;
    const double wrapped = std::atan2(reading.sin, reading.cos);
    Phase phase;
    phase.fringes = fringe;
    phase.add(middle + std::remainder(wrapped - middle, units::two_pi));
    return phase;
}

}  // namespace ringlock::readout
