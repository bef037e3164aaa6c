#include "engine/reader/notch.hpp"

#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::reader {

Notch::Notch(double bandwidth_hz, double latch_hz, double dither_hz)
    : bandwidth_hz_(bandwidth_hz),
      latch_hz_(latch_hz),
      dither_hz_(dither_hz),
      step_(units::pi * bandwidth_hz / latch_hz) {}

void Notch::take(const Latched& latched) {
    if (!begun_) angle_arcsec_ = latched.angle_arcsec;
    const double increment = begun_ ? latched.angle_arcsec - last_arcsec_ : 0.0;
    begun_ = true;
    last_arcsec_ = latched.angle_arcsec;
    const double cycles = dither_hz_ * latched.time_s;
    const double x = units::two_pi * (cycles - std::floor(cycles));
    const double cosine = std::cos(x);
    const double sine = std::sin(x);
    const double left = increment - (cosine_weight_ * cosine + sine_weight_ * sine);
    cosine_weight_ += 2.0 * step_ * left * cosine;
    sine_weight_ += 2.0 * step_ * left * sine;
    angle_arcsec_ += (1.0 - step_) * left;
}

double Notch::delay_s() const {
    const double c = std::cos(units::two_pi * dither_hz_ / latch_hz_);
    return step_ / ((1.0 - c) * (1.0 - step_)) / latch_hz_;
}

double Notch::warm_up_s() const { return 8.0 / (units::pi * bandwidth_hz_); }

}  // namespace ringlock::reader
