#include "analysis/noise/losses/cosine_pair.hpp"

#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::noise {

CosinePair::CosinePair(std::size_t n) : turn_(n), in_(n), out_(n) {
    fft_.SetFlag(Eigen::FFT<double>::Unscaled);
    for (std::size_t j = 0; j < n; ++j) {
        turn_[j] = std::polar(1.0, 0.5 * units::pi * static_cast<double>(j) / static_cast<double>(n));
    }
}

void CosinePair::to_coefficients(Pair& series) {
    const std::size_t n = size();
    for (std::size_t i = 0; 2 * i < n; ++i) in_[i] = series[2 * i];
    for (std::size_t i = 0; 2 * i + 1 < n; ++i) in_[n - 1 - i] = series[2 * i + 1];
    fft_.fwd(out_.data(), in_.data(), static_cast<Eigen::Index>(n));
    // Of a real series A the coefficient is the real part of exp(-i pi j/2n) A_j. Of A + iB, whose A_j and B_j are not
    // apart, the conjugate at n - j gives A_j - i B_j.
    const auto count = static_cast<double>(n);
    const double scale = 0.5 * std::sqrt(2.0 / count);
    series[0] = out_[0] / std::sqrt(count);
    for (std::size_t j = 1; j < n; ++j) {
        const std::complex<double> back = std::conj(turn_[j]);
        const std::complex<double> sum = back * out_[j];
        const std::complex<double> mirrored = back * std::conj(out_[n - j]);
        series[j] = scale * std::complex<double>(sum.real() + mirrored.real(), sum.imag() - mirrored.imag());
    }
}

void CosinePair::to_series(Pair& coefficients) {
    const std::size_t n = size();
    const auto count = static_cast<double>(n);
    const double scale = 1.0 / std::sqrt(2.0 * count);
    in_[0] = coefficients[0] / std::sqrt(count);
    for (std::size_t j = 1; j < n; ++j) {
        const std::complex<double> a = coefficients[j];
        const std::complex<double> b = coefficients[n - j];
        in_[j] = scale * turn_[j] * std::complex<double>(a.real() + b.imag(), a.imag() - b.real());
    }
    fft_.inv(out_.data(), in_.data(), static_cast<Eigen::Index>(n));
    for (std::size_t i = 0; 2 * i < n; ++i) coefficients[2 * i] = out_[i];
    for (std::size_t i = 0; 2 * i + 1 < n; ++i) coefficients[2 * i + 1] = out_[n - 1 - i];
}

}  // namespace ringlock::noise
