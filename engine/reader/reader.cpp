#include "engine/reader/reader.hpp"

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/random/normal_lanes.hpp"

namespace ringlock::reader {

namespace {

/// A detector's voltage, in fringe amplitudes, as the converter gives it.
double converted(double value, int adc_bits) {
    if (adc_bits == 0) return value;
    constexpr double range = readout::Electronics::adc_range;
    const double steps = std::ldexp(0.5, adc_bits) / range;
    return std::nearbyint(std::clamp(value, -range, range) * steps) / steps;
}

}  // namespace

Reader::Reader(const Settings& settings, double output_hz, const Source& source)
    : settings_(settings),
      source_(source),
      output_hz_(output_hz),
      decimation_(std::max<std::int64_t>(1, std::llround(latch_hz(settings, output_hz) / output_hz))),
      stripper_(make_stripper(settings, latch_hz(settings, output_hz), source.dither_hz)) {}

double Reader::latched_fringes(const Instant& instant, double count_error) const {
    const double quarter = std::floor(4.0 * instant.fringes) / 4.0;
    switch (settings_.fraction) {
        case Fraction::ideal:
            break;
        case Fraction::none:
            return instant.whole_fringes + quarter + 0.25 * count_error;
        case Fraction::detectors: {
            // The detectors' phase on the branch nearest to the middle of the counted quarter fringe.
            const double psi = units::two_pi * (instant.fringes - std::floor(instant.fringes));
            const gyro::Ellipse& ellipse = source_.ellipse;
            const auto step = 2 * static_cast<std::uint64_t>(instant.tick);
            const double rms = source_.electronics.ideal ? 0.0 : source_.electronics.detector_noise_relative;
            const auto noise = [&](std::uint64_t which) {
                if (rms == 0.0) return 0.0;
                return rms * random::normal(source_.who, random::Purpose::latched_detectors, step + which);
            };
            const int bits = source_.electronics.ideal ? 0 : source_.electronics.adc_bits;
            const double sine = converted((1.0 + ellipse.gain) * std::sin(psi) + ellipse.offset_sin + noise(0), bits);
            const double cosine =
                converted(std::cos(psi + ellipse.orthogonality_rad) + ellipse.offset_cos + noise(1), bits);
            const double counted = quarter + 0.125 + 0.25 * count_error;
            const double read = std::atan2(sine, cosine) / units::two_pi;
            return instant.whole_fringes + (read + std::nearbyint(counted - read));
        }
    }
    return instant.whole_fringes + instant.fringes + 0.25 * count_error;
}

Latched Reader::latched(const Instant& instant, double angle_arcsec) const {
    // The reference is late and of another gain; its electronics give the quadrature as well as the angle.
    const double late_rad = units::two_pi * source_.dither_hz * settings_.reference_delay_s;
    const double gain = source_.scale_factor_arcsec * (1.0 + settings_.reference_gain_error_relative);
    const double c = gain * std::cos(late_rad);
    const double s = gain * std::sin(late_rad);
    double dither = c * instant.dither_fringes - s * instant.dither_ahead_fringes;
    double ahead = c * instant.dither_ahead_fringes + s * instant.dither_fringes;
    if (settings_.reference_noise_arcsec > 0.0) {
        const auto step = 2 * static_cast<std::uint64_t>(instant.tick);
        const auto noise = [&](std::uint64_t which) {
            return settings_.reference_noise_arcsec *
                   random::normal(source_.who, random::Purpose::dither_reference, step + which);
        };
        dither += noise(0);
        ahead += noise(1);
    }
    return {instant.time_s, angle_arcsec, dither, ahead};
}

/// Noise of the measured dither moves its zero crossing, and the dither goes on meanwhile: the angle at which the count
/// is latched is off by that noise.
Instant Reader::moved_crossing(Instant instant) const {
    if (!(settings_.reference_noise_arcsec > 0.0)) return instant;
    const auto number = 2 * static_cast<std::uint64_t>(instant.time_s * source_.dither_hz);
    const double noise = random::normal(source_.who, random::Purpose::dither_reference, number);
    instant.fringes -= settings_.reference_noise_arcsec * noise / source_.scale_factor_arcsec;
    return instant;
}

void Reader::read(std::span<const Instant> instants, std::span<const double> correction_fringes,
                  std::span<const double> count_errors) {
    angles_arcsec_.clear();
    first_output_ = next_output_;
    for (const Instant& instant : instants) {
        // Counts are missed between turns; the counter has the error that it had at the turn before.
        const double count_error = count_errors.empty() ? 0.0
                                   : instant.row == 0   ? last_count_error_
                                                        : count_errors[instant.row - 1];
        const double correction = correction_fringes.empty() ? 0.0 : correction_fringes[instant.row];
        if (instant.crossing) {
            const double fringes = latched_fringes(moved_crossing(instant), count_error) - correction;
            stripper_->take_crossing(instant.time_s, source_.scale_factor_arcsec * fringes);
            continue;
        }
        const double angle_arcsec = source_.scale_factor_arcsec * (latched_fringes(instant, count_error) - correction);
        stripper_->take(latched(instant, angle_arcsec));
        if (instant.tick % decimation_ != 0) continue;
        angles_arcsec_.push_back(stripper_->angle_arcsec());
        ++next_output_;
    }
    if (!count_errors.empty()) last_count_error_ = count_errors.back();
}

std::int64_t Reader::warm_up_outputs() const { return reader::warm_up_outputs(*stripper_, output_hz_); }

}  // namespace ringlock::reader
