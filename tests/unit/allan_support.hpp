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

/// A sinusoidal rate: amplitude [arcsec/s], frequency [Hz], phase at the beginning of the record [rad].
struct TrueLine {
    double amplitude = 0.0;
    double frequency_hz = 0.0;
    double phase_rad = 0.0;
};

/// True coefficients in arcsec and seconds: Q arcsec, N arcsec/sqrt(s), B deg/h, K arcsec/s/sqrt(s), R arcsec/s^2,
/// correlated noise by its rms [arcsec/s] and its time [s], sinusoids.
struct Truth {
    double q = 0.0;
    double n = 0.0;
    double b = 0.0;
    double k = 0.0;
    double r = 0.0;
    double correlated_rms = 0.0;
    double correlation_time_s = 0.0;
    std::vector<TrueLine> lines{};
};

/// Ornstein-Uhlenbeck rate: its exact integral over consecutive intervals tau0.
class RelaxingRate {
   public:
    RelaxingRate(double variance, double relaxation_rate, double tau0, random::NormalStream& normal)
        : state_(std::sqrt(variance) * normal()) {
        const double a = relaxation_rate * tau0;
        const double gone = -std::expm1(-a);
        keep_ = std::exp(-a);
        from_state_ = gone / relaxation_rate;
        noise_state_ = std::sqrt(variance * -std::expm1(-2.0 * a));
        shared_ = variance * gone * gone / relaxation_rate / noise_state_;
        // 2a - 3 + 4 e^-a - e^-2a loses all digits for small a; its series begins 2 a^3/3.
        const double bracket = a < 0.02 ? a * a * a * (2.0 / 3.0 - 0.5 * a + 7.0 * a * a / 30.0)
                                        : 2.0 * a - 3.0 + 4.0 * std::exp(-a) - std::exp(-2.0 * a);
        noise_integral_ =
            std::sqrt(std::fmax(0.0, variance * bracket / (relaxation_rate * relaxation_rate) - shared_ * shared_));
    }
    double integral(random::NormalStream& normal) {
        const double g = normal();
        const double sum = state_ * from_state_ + shared_ * g + noise_integral_ * normal();
        state_ = state_ * keep_ + noise_state_ * g;
        return sum;
    }

   private:
    double state_, keep_, from_state_, noise_state_, noise_integral_, shared_;
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
    std::vector<RelaxingRate> relaxing;
    if (t.b > 0.0) {
        const double variance = t.b * t.b * std::numbers::ln2 / std::numbers::pi;
        const double lowest = 1e-3 / (static_cast<double>(n) * tau0);
        for (double rate = lowest; rate < 200.0 / tau0; rate *= 2.0) relaxing.emplace_back(variance, rate, tau0, slow);
    }
    if (t.correlated_rms > 0.0) {
        relaxing.emplace_back(t.correlated_rms * t.correlated_rms, 1.0 / t.correlation_time_s, tau0, slow);
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
        for (RelaxingRate& f : relaxing) sum += f.integral(slow);
        angle[i + 1] = sum + t.q * angle_white();
    }
    for (const TrueLine& line : t.lines) {
        const double turn = 2.0 * std::numbers::pi * line.frequency_hz;
        for (std::size_t i = 0; i <= n; ++i) {
            angle[i] -= line.amplitude / turn * std::cos(turn * tau0 * static_cast<double>(i) + line.phase_rad);
        }
    }
    return angle;
}

}  // namespace ringlock::test
