#pragma once
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "engine/random/stream.hpp"

/// Records with known noise for the tests of the Allan analysis.
namespace ringlock::test {

/// The 1000 frequencies of NIST SP1065 section 12.4: n' = 16807 n mod (2^31 - 1) from 1234567890, over 2^31 - 1.
inline std::vector<double> sp1065_frequencies() {
    constexpr std::int64_t modulus = 2147483647;
    std::vector<double> y;
    for (std::int64_t n = 1234567890; y.size() < 1000; n = 16807 * n % modulus) {
        y.push_back(static_cast<double>(n) / static_cast<double>(modulus));
    }
    return y;
}

/// True coefficients in arcsec and seconds: Q arcsec, N arcsec/sqrt(s), B deg/h, K arcsec/s/sqrt(s), R arcsec/s^2.
struct Truth {
    double q = 0.0;
    double n = 0.0;
    double b = 0.0;
    double k = 0.0;
    double r = 0.0;
};

/// Angle record of n increments tau0 apart. Each noise is the exact integral of its continuous process over the
/// interval; flicker is a sum of Ornstein-Uhlenbeck rates an octave apart in bandwidth, from far below 1/T to far above
/// 1/tau0.
inline std::vector<double> simulate_angle(const Truth& t, std::size_t n, double tau0, std::uint64_t seed) {
    using random::NormalStream;
    using random::Purpose;
    NormalStream white({seed, 0}, Purpose::noise_injection);
    NormalStream angle_white({seed, 1}, Purpose::detector_noise);
    NormalStream walk({seed, 2}, Purpose::rate_random_walk);
    NormalStream slow({seed, 3}, Purpose::bias_instability);
    struct Relaxing {
        double rate, keep, state, from_state, noise_state, noise_integral, shared;
    };
    std::vector<Relaxing> flicker;
    if (t.b > 0.0) {
        const double variance = t.b * t.b * std::numbers::ln2 / std::numbers::pi;
        const double lowest = 1e-3 / (static_cast<double>(n) * tau0);
        for (double rate = lowest; rate < 200.0 / tau0; rate *= 2.0) {
            const double a = rate * tau0;
            const double gone = -std::expm1(-a);
            const double var_state = variance * -std::expm1(-2.0 * a);
            const double cov = variance * gone * gone / rate;
            // 2a - 3 + 4 e^-a - e^-2a loses all digits for small a; its series begins 2 a^3/3.
            const double bracket = a < 0.02 ? a * a * a * (2.0 / 3.0 - 0.5 * a + 7.0 * a * a / 30.0)
                                            : 2.0 * a - 3.0 + 4.0 * std::exp(-a) - std::exp(-2.0 * a);
            const double var_integral = variance * bracket / (rate * rate);
            const double shared = cov / std::sqrt(var_state);
            flicker.push_back({rate, std::exp(-a), std::sqrt(variance) * slow(), gone / rate, std::sqrt(var_state),
                               std::sqrt(std::fmax(0.0, var_integral - shared * shared)), shared});
        }
    }
    std::vector<double> angle(n + 1);
    double sum = 0.0;
    double rate = 3.0;
    angle[0] = t.q * angle_white();
    for (std::size_t i = 0; i < n; ++i) {
        sum += t.n * std::sqrt(tau0) * white() + rate * tau0 + t.r * tau0 * tau0 * static_cast<double>(i);
        if (t.k > 0.0) {
            const double step = t.k * std::sqrt(tau0) * walk();
            sum += tau0 * (0.5 * step + t.k * std::sqrt(tau0 / 12.0) * walk());
            rate += step;
        }
        for (Relaxing& f : flicker) {
            const double g = slow();
            sum += f.state * f.from_state + f.shared * g + f.noise_integral * slow();
            f.state = f.state * f.keep + f.noise_state * g;
        }
        angle[i + 1] = sum + t.q * angle_white();
    }
    return angle;
}

}  // namespace ringlock::test
