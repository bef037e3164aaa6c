#pragma once
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <functional>
#include <memory>
#include <random>
#include <string>

#include "engine/core/phase.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/theory.hpp"
#include "tests/support/direct.hpp"
#include "tests/support/turn_map.hpp"

namespace ringlock::test {

/// Gao & Deng 2007.
inline gyro::Setup paper_device() {
    gyro::Setup setup;
    setup.scale_factor_arcsec = 0.5;
    setup.lockin_threshold_deg_h = 300.0;
    setup.dither_frequency_hz = 783.4 / units::two_pi;
    setup.dither_peak_rate_deg_s = 109.1;
    return setup;
}

/// Uniform deviates of a fixed seed.
class Uniform {
   public:
    explicit Uniform(std::uint64_t seed) : engine_(seed) {}
    double operator()(double low, double high) {
        return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
    }

   private:
    std::mt19937_64 engine_;
};

/// Half cycles of the device's own rate and coupling, and of amplitudes up to `margin_rad` from its own.
inline propagate::HalfCycleRanges ranges(const gyro::Device& device, double margin_rad) {
    const double a = device.dither_amplitude_rad;
    const double b = device.coupling.b_rad_s;
    return {{a - margin_rad, a + margin_rad}, {device.input_rate_rad_s, device.input_rate_rad_s}, {b, b}};
}

enum class Method { turn_map, direct };

inline std::unique_ptr<Propagator> make_propagator(Method method, const gyro::Device& device, double margin_rad = 0.0,
                                                   double tolerance_rad = 1e-11) {
    if (method == Method::direct) return std::make_unique<DirectIntegrator>(device.coupling, tolerance_rad);
    return std::make_unique<TurnMap>(device, ranges(device, margin_rad), tolerance_rad);
}

/// A map of the circle psi -> psi + shift + 2 arg(1 + z exp(-i psi)), which is what any stretch of the motion is.
struct CircleMap {
    double shift_rad;
    std::complex<double> z;

    /// Locked: the map has a fixed point, |trace| > 2.
    bool locked() const { return std::norm(z) >= std::pow(std::sin(0.5 * shift_rad), 2); }
    /// Mean phase advance per application, in [0, 2 pi), of the unlocked map: its rotation number.
    double rotation_rad() const {
        if (locked()) return 0.0;
        const double shift = shift_rad - units::two_pi * std::floor(shift_rad / units::two_pi);
        return 2.0 * std::acos(std::cos(0.5 * shift) / std::sqrt(1.0 - std::norm(z)));
    }
};

/// Finds the circle map from its values at equidistant phases: mean and first harmonic of the gain, exact up to |z|^N.
inline CircleMap circle_map(const std::function<double(double)>& gain) {
    constexpr int n = 16;
    CircleMap map{0.0, 0.0};
    for (int i = 0; i < n; ++i) {
        const double psi = units::two_pi * i / n;
        const double value = gain(psi);
        map.shift_rad += value / n;
        // gain = shift + Im(2 z exp(-i psi)) + ...
        map.z += std::complex<double>(0.0, 1.0) * value * std::polar(1.0, psi) / static_cast<double>(n);
    }
    return map;
}

/// The map of one dither cycle from minimum to minimum, input rotation included.
inline CircleMap cycle_map(Method method, const gyro::Setup& setup) {
    const gyro::Device device(setup);
    const auto propagator = make_propagator(method, device);
    return circle_map([&](double psi) {
        const auto up = device.half_cycle(1.0, device.dither_amplitude_rad);
        const auto down = device.half_cycle(-1.0, device.dither_amplitude_rad);
        const double first = propagator->lockin_gain_rad(psi, up);
        Phase top(psi + up.plain_phase_total_rad() + first);
        const double second = propagator->lockin_gain_rad(top.remainder_rad, down);
        return first + second + device.input_rate_rad_s * device.period_s();
    });
}

}  // namespace ringlock::test
