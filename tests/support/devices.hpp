#pragma once
#include <array>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/gyro/theory.hpp"

namespace ringlock::test {

/// Scale factor of a ring: K = lambda L/(4 A) for a path of length L around the area A, of light of 632.8 nm.
struct NamedDevice {
    const char* name;
    double scale_factor_arcsec;
    double lockin_threshold_deg_h;
};

/// Gyros from 26 fringes in a half cycle of 400 Hz and 100 deg/s to the paper's 2005; thresholds that an angle random
/// walk of 0.0035 deg/sqrt(h) allows.
inline constexpr std::array named_devices = {
    NamedDevice{"triangle-20mm", 11.13, 95.0},  NamedDevice{"triangle-51mm", 4.45, 150.0},
    NamedDevice{"triangle-53mm", 4.24, 153.0},  NamedDevice{"triangle-80mm", 2.83, 188.0},
    NamedDevice{"triangle-107mm", 2.12, 217.0}, NamedDevice{"square-50mm", 2.61, 195.0},
    NamedDevice{"square-70mm", 1.86, 231.0},    NamedDevice{"square-90mm", 1.45, 262.0},
    NamedDevice{"gao-deng-2007", 0.5, 300.0}};

inline gyro::Setup setup_of(const NamedDevice& device) {
    gyro::Setup setup;
    const bool paper = device.scale_factor_arcsec == 0.5;
    setup.scale_factor_arcsec = device.scale_factor_arcsec;
    setup.lockin_threshold_deg_h = device.lockin_threshold_deg_h;
    setup.dither_frequency_hz = paper ? 783.4 / units::two_pi : 400.0;
    setup.dither_peak_rate_deg_s = paper ? 109.1 : 100.0;
    return setup;
}

/// A gyro of that many fringes in a half cycle and kicks of that size, with the dither of the others.
inline gyro::Setup setup_of_size(double fringes, double kick_rad) {
    gyro::Setup setup = setup_of(named_devices[0]);
    setup.scale_factor_arcsec =
        setup.dither_peak_rate_deg_s * units::arcsec_per_deg / (units::pi * fringes * setup.dither_frequency_hz);
    setup.lockin_threshold_deg_h = 1.0;
    setup.lockin_threshold_deg_h = kick_rad / gyro::turn_kick_rad(setup);
    return setup;
}

}  // namespace ringlock::test
