#pragma once
#include <vector>

#include "tests/closure/generator/generator.hpp"
#include "tests/closure/suite/suite.hpp"

/// The gyros of the records of turns.
namespace ringlock::test::closure {

constexpr double nominal_threshold_deg_h = 300.0;

/// Truths of the gyro itself, by the seed.
struct Device {
    double threshold_deg_h, peak_rate_deg_s, rate_deg_h;
    double declared_threshold_deg_h = nominal_threshold_deg_h;
    double injected_rad = 0.0;
    double readout_noise = 0.005;
    double scale_factor_arcsec = Truth{}.scale_factor_arcsec;
    double dither_frequency_hz = Truth{}.dither_frequency_hz;
    double duration_s = 0.0;
    std::vector<double> profile_time_s = {};
    std::vector<double> profile_rate_deg_h = {};
};

Device device_of(const Case& of);

}  // namespace ringlock::test::closure
