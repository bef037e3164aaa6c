#include "engine/reader/reference.hpp"

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::reader {

Reference::Reference(const Settings& settings, double latch_hz, double dither_hz)
    : settings_(settings), dither_hz_(dither_hz), latch_hz_(latch_hz) {
    if (settings.reference_learning_s > 0.0) step_ = std::min(1.0, 2.0 / (settings.reference_learning_s * latch_hz));
}

void Reference::take(const Latched& latched) {
    const auto estimate = [&](double dither, double ahead) { return gain_.real() * dither + gain_.imag() * ahead; };
    if (step_ > 0.0 && begun_) {
        const double dither = latched.dither_arcsec - last_.dither_arcsec;
        const double ahead = latched.dither_ahead_arcsec - last_.dither_ahead_arcsec;
        const double left = (latched.angle_arcsec - last_.angle_arcsec) - estimate(dither, ahead);
        power_ += 0.5 * step_ * (dither * dither + ahead * ahead - power_);
        averaged_ += 0.5 * step_ * (1.0 - averaged_);
        if (power_ > 0.0) gain_ += step_ * left * averaged_ / power_ * std::complex<double>(dither, ahead);
    }
    begun_ = true;
    last_ = latched;
    angle_arcsec_ = latched.angle_arcsec - estimate(latched.dither_arcsec, latched.dither_ahead_arcsec);
}

double Reference::residue_relative() const {
    if (step_ > 0.0) return 0.0;
    const double late_rad = units::two_pi * dither_hz_ * settings_.reference_delay_s;
    return std::abs(1.0 - (1.0 + settings_.reference_gain_error_relative) * std::polar(1.0, -late_rad));
}

double Reference::warm_up_s() const { return 8.0 * settings_.reference_learning_s; }

}  // namespace ringlock::reader
