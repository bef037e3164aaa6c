#include "analysis/noise/spectrum.hpp"

#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>

namespace ringlock::noise {
namespace {

constexpr double pi = std::numbers::pi;

/// Sum over all integers k of |x + k|^-3, for 0 < x <= 1/2.
double alias_sum_cubes(double x) {
    constexpr int direct = 6;
    double sum = 1.0 / (x * x * x);
    for (int k = 1; k < direct; ++k) {
        sum += std::pow(k + x, -3.0) + std::pow(k - x, -3.0);
    }
    // Euler-Maclaurin for the tails that begin at direct + x and direct - x
    for (const double a : {direct + x, direct - x}) {
        sum += 0.5 / (a * a) + 0.5 / (a * a * a) + 0.25 / (a * a * a * a) - (1.0 / 12.0) * std::pow(a, -6.0);
    }
    return sum;
}

/// Sine integral Si(pi j).
double sine_integral_at(double j) {
    const double k = pi * j;
    if (j < 4.5) {
        double term = k;
        double sum = k;
        for (int i = 1; i < 60; ++i) {
            term *= -k * k / ((2.0 * i) * (2.0 * i + 1.0));
            sum += term / (2.0 * i + 1.0);
        }
        return sum;
    }
    const double sign = std::fmod(j, 2.0) == 0.0 ? 1.0 : -1.0;
    const double k2 = k * k;
    return 0.5 * pi - sign / k * (1.0 - 2.0 / k2 + 24.0 / (k2 * k2));
}

/// Variance of cosine j of a finite piece of flicker over S(f_j): (2/pi) Si(pi j) - (1 - (-1)^j) 2/(pi^2 j).
double flicker_end_correction(double index) {
    if (index > 64.0) return 1.0 - 2.0 / (pi * pi * index);
    const bool odd = std::fmod(index, 2.0) != 0.0;
    return 2.0 / pi * sine_integral_at(index) - (odd ? 4.0 / (pi * pi * index) : 0.0);
}

bool small_factors_only(std::size_t n) {
    for (const std::size_t p : {2, 3, 5, 7, 11, 13}) {
        while (n % p == 0) n /= p;
    }
    return n == 1;
}

/// Orthonormal DCT-II by one complex Fourier transform of the same length (J. Makhoul, IEEE Trans. ASSP 28 (1980) 27).
std::vector<double> cosine_coefficients(std::span<const double> x) {
    const std::size_t n = x.size();
    std::vector<std::complex<double>> reordered(n);
    std::vector<std::complex<double>> transformed(n);
    for (std::size_t i = 0; 2 * i < n; ++i) reordered[i] = x[2 * i];
    for (std::size_t i = 0; 2 * i + 1 < n; ++i) reordered[n - 1 - i] = x[2 * i + 1];
    Eigen::FFT<double> fft;
    fft.fwd(transformed.data(), reordered.data(), static_cast<Eigen::Index>(n));
    const double scale = std::sqrt(2.0 / static_cast<double>(n));
    std::vector<double> out(n - 1);
    for (std::size_t j = 1; j < n; ++j) {
        const double angle = 0.5 * pi * static_cast<double>(j) / static_cast<double>(n);
        out[j - 1] = scale * (transformed[j].real() * std::cos(angle) + transformed[j].imag() * std::sin(angle));
    }
    return out;
}

/// Last coefficient of the bin that begins with j: single ones first, then bins 4 % wide.
std::size_t bin_end(std::size_t j) { return j < 40 ? j : j + static_cast<std::size_t>(0.04 * static_cast<double>(j)); }

}  // namespace

TermValues shapes(double x, double index) {
    const double s = std::sin(pi * x);
    const double s2 = s * s;
    TermValues g;
    g[quantisation] = 4.0 * s2;
    g[angle_random_walk] = 1.0;
    g[flicker] = s2 / (2.0 * pi * pi * pi) * alias_sum_cubes(x) * (index > 0.0 ? flicker_end_correction(index) : 1.0);
    g[rate_random_walk] = (3.0 - 2.0 * s2) / (12.0 * s2);
    return g;
}

double Spectrum::corner(std::size_t j) const {
    return 2.0 / std::sqrt(static_cast<double>(samples)) * std::cos(pi * x(j));
}

double Spectrum::ramp(std::size_t j) const {
    if (j % 2 == 0) return 0.0;
    const double s = std::sin(pi * x(j));
    return -std::sqrt(2.0 / static_cast<double>(samples)) * std::cos(pi * x(j)) / (2.0 * s * s);
}

Spectrum cosine_spectrum(std::span<const double> rate) {
    Spectrum out;
    out.samples = rate.size();
    while (!small_factors_only(out.samples)) --out.samples;
    const std::size_t n = out.samples;

    double mean = 0.0;
    for (std::size_t i = 0; i < n; ++i) mean += (rate[i] - rate[0]) / static_cast<double>(n);
    std::vector<double> centred(n);
    for (std::size_t i = 0; i < n; ++i) centred[i] = (rate[i] - rate[0]) - mean;
    out.z = cosine_coefficients(centred);

    for (std::size_t begin = 1; begin < n;) {
        const std::size_t end = std::min(n - 1, bin_end(begin));
        Bin bin;
        for (std::size_t j = begin; j <= end; ++j) {
            const std::size_t parity = j % 2;
            const double z = out.z[j - 1];
            const double u = out.corner(j);
            bin.count += 1.0;
            bin.power += z * z;
            bin.corner2[parity] += u * u;
            bin.corner_data[parity] += u * z;
            if (parity == 1) {
                const double d = out.ramp(j);
                bin.ramp2 += d * d;
                bin.ramp_data += d * z;
                bin.ramp_corner += d * u;
            }
        }
        const double middle = 0.5 * static_cast<double>(begin + end);
        bin.x = 0.5 * middle / static_cast<double>(n);
        bin.shape = shapes(bin.x, middle);
        if (begin != end) bin.shape[flicker] = shapes(bin.x)[flicker] * (1.0 - 2.0 / (pi * pi * middle));
        out.bins.push_back(bin);
        begin = end + 1;
    }
    return out;
}

}  // namespace ringlock::noise
