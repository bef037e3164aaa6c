#include "tests/bench/exact_flicker.hpp"

#include <bit>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "engine/core/error.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::bench {
namespace {

double difference_covariance(std::size_t lag) {
    const auto t = static_cast<long double>(lag);
    constexpr auto pi = std::numbers::pi_v<long double>;
    if (lag > 40) {
        // fourth difference = D^4 + D^6/6 + D^8/80 + ...
        const long double t2 = t * t;
        return static_cast<double>(-(1.0L + 1.0L / t2 + 1.5L / (t2 * t2)) / (pi * t2));
    }
    const auto f = [](long double at) {
        at = std::abs(at);
        return at > 0.0L ? -0.5L * at * at * (std::log(at) - 1.5L) / pi : 0.0L;
    };
    return static_cast<double>(-(f(t - 2) - 4.0L * f(t - 1) + 6.0L * f(t) - 4.0L * f(t + 1) + f(t + 2)));
}

}  // namespace

ExactFlicker::ExactFlicker(std::size_t samples) : samples_(samples) {
    const std::size_t half = std::bit_ceil(samples);
    std::vector<std::complex<double>> circle(2 * half);
    for (std::size_t i = 0; i <= half; ++i) circle[i] = difference_covariance(i);
    for (std::size_t i = 1; i < half; ++i) circle[2 * half - i] = circle[i];
    std::vector<std::complex<double>> eigenvalues(2 * half);
    Eigen::FFT<double> fft;
    fft.fwd(eigenvalues.data(), circle.data(), static_cast<Eigen::Index>(2 * half));
    for (const std::complex<double>& value : eigenvalues) {
        if (value.real() < -1e-9) throw RunError("a circle of differences of flicker has a negative eigenvalue");
        root_.push_back(std::sqrt(std::max(0.0, value.real()) / static_cast<double>(2 * half)));
    }
}

std::vector<double> ExactFlicker::rates(std::uint64_t seed) const {
    random::NormalStream normal({seed, 5}, random::Purpose::bias_instability);
    std::vector<std::complex<double>> in(root_.size());
    std::vector<std::complex<double>> out(root_.size());
    for (std::size_t i = 0; i < in.size(); ++i) {
        const double real = normal();
        in[i] = root_[i] * std::complex<double>(real, normal());
    }
    Eigen::FFT<double> fft;
    fft.fwd(out.data(), in.data(), static_cast<Eigen::Index>(in.size()));
    std::vector<double> rates(samples_);
    for (std::size_t i = 1; i < samples_; ++i) rates[i] = rates[i - 1] + out[i].real();
    return rates;
}

}  // namespace ringlock::bench
