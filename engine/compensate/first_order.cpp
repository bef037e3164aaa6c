#include "engine/compensate/first_order.hpp"

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::compensate {

namespace {
constexpr std::int64_t memory_turns = 512;
}

FirstOrder::FirstOrder(const Calibration& calibration, double factor)
    : scale_(factor * calibration.b_rad_s * std::sqrt(units::pi)) {}

double FirstOrder::Average::update(double value) {
    if (value > 0.0) {
        count_ = std::min(count_ + 1, memory_turns);
        mean_ += (value - mean_) / static_cast<double>(count_);
    }
    return mean_;
}

void FirstOrder::observe(const readout::Reading& reading) {
    const double amplitude = std::hypot(reading.sin, reading.cos);
    const bool minimum = reading.direction > 0;
    // sin +- cos of the phase; the detectors' common scale drops out.
    const double projection =
        amplitude > 0.0 ? (reading.sin + (minimum ? reading.cos : -reading.cos)) / amplitude : 0.0;
    const auto half_kick = [&](std::size_t side, double acceleration) {
        const double a = acceleration_[side + (minimum ? 0 : 2)].update(acceleration);
        return a > 0.0 ? scale_ / std::sqrt(a) * projection : 0.0;
    };
    error_rad_ += after_last_rad_ + half_kick(0, reading.accel_before_rad_s2);
    after_last_rad_ = half_kick(1, reading.accel_after_rad_s2);
}

}  // namespace ringlock::compensate
