#include "analysis/noise/model/spectrum.hpp"

#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>

#include "engine/core/units.hpp"

namespace ringlock::noise {
namespace {

using units::pi;

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

double Spectrum::corner(std::size_t j) const {
    return 2.0 / std::sqrt(static_cast<double>(samples)) * std::cos(pi * x(j));
}

double Spectrum::ramp(std::size_t j) const {
    if (j % 2 == 0) return 0.0;
    const double s = std::sin(pi * x(j));
    return -std::sqrt(2.0 / static_cast<double>(samples)) * std::cos(pi * x(j)) / (2.0 * s * s);
}

void Spectrum::sum_bins() {
    const std::size_t n = samples;
    bins.clear();
    for (std::size_t begin = 1; begin < n;) {
        const std::size_t end = std::min(n - 1, bin_end(begin));
        Bin bin;
        for (std::size_t j = begin; j <= end; ++j) {
            const std::size_t parity = j % 2;
            const double value = z[j - 1];
            const double u = corner(j);
            bin.count += 1.0;
            bin.power += value * value;
            if (!spread.empty()) bin.power += spread[j - 1];
            bin.corner2[parity] += u * u;
            bin.corner_data[parity] += u * value;
            if (parity == 1) {
                const double d = ramp(j);
                bin.ramp2 += d * d;
                bin.ramp_data += d * value;
                bin.ramp_corner += d * u;
            }
        }
        const double middle = 0.5 * static_cast<double>(begin + end);
        bin.x = 0.5 * middle / static_cast<double>(n);
        bin.shape = shapes(bin.x, middle);
        bin.sin2 = std::pow(std::sin(pi * bin.x), 2);
        if (begin != end) bin.shape[flicker] = shapes(bin.x)[flicker] * (1.0 - 2.0 / (pi * pi * middle));
        bins.push_back(bin);
        begin = end + 1;
    }
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

    out.sum_bins();
    return out;
}

}  // namespace ringlock::noise
