#include "analysis/stability/density.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "analysis/noise/model/shapes.hpp"
#include "analysis/noise/model/spectrum.hpp"
#include "engine/core/units.hpp"

namespace ringlock::stability {
namespace {

/// Periodic, so that two windows half a segment apart sum to a constant.
std::vector<double> hann(std::size_t size) {
    std::vector<double> out(size);
    for (std::size_t i = 0; i < size; ++i) {
        out[i] = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(size));
    }
    return out;
}

bool is_whole(std::span<const double> values) {
    return std::none_of(values.begin(), values.end(), [](double v) { return std::isnan(v); });
}

/// Less its mean and under the window.
void window_into(std::vector<double>& out, std::span<const double> segment, const std::vector<double>& window) {
    double mean = 0.0;
    for (const double v : segment) mean += (v - segment[0]) / static_cast<double>(segment.size());
    for (std::size_t i = 0; i < segment.size(); ++i) out[i] = window[i] * (segment[i] - segment[0] - mean);
}

}  // namespace

std::size_t welch_segment(std::size_t samples) {
    constexpr std::size_t least = 8;
    std::size_t segment = least;
    while (2 * segment <= samples / 8) segment *= 2;
    return segment;
}

std::vector<DensityPoint> welch_density(std::span<const double> rate, double tau0_s, std::size_t segment) {
    const std::vector<double> window = hann(segment);
    double norm = 0.0;
    for (const double w : window) norm += w * w;
    std::vector<double> windowed(segment);
    std::vector<std::complex<double>> transformed(segment);
    std::vector<double> sum(segment / 2 + 1);
    std::size_t count = 0;
    Eigen::FFT<double> fft;
    for (std::size_t begin = 0; begin + segment <= rate.size(); begin += std::max<std::size_t>(1, segment / 2)) {
        const std::span<const double> piece = rate.subspan(begin, segment);
        if (!is_whole(piece)) continue;
        window_into(windowed, piece, window);
        fft.fwd(transformed.data(), windowed.data(), static_cast<Eigen::Index>(segment));
        for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += std::norm(transformed[k]);
        ++count;
    }
    std::vector<DensityPoint> out;
    if (count == 0) return out;
    for (std::size_t k = 1; k < sum.size(); ++k) {
        out.push_back({.frequency_hz = static_cast<double>(k) / (static_cast<double>(segment) * tau0_s),
                       .density = tau0_s * sum[k] / (norm * static_cast<double>(count)),
                       .count = count});
    }
    return out;
}

std::vector<DensityPoint> cosine_density(std::span<const double> rate, double tau0_s) {
    std::vector<DensityPoint> out;
    for (const noise::Bin& bin : noise::cosine_spectrum(rate).bins) {
        out.push_back({.frequency_hz = bin.x / tau0_s,
                       .density = tau0_s * bin.power / bin.count,
                       .count = static_cast<std::size_t>(bin.count)});
    }
    return out;
}

std::vector<double> model_density(const noise::NoiseFit& fit, double tau0_s, std::span<const double> frequencies_hz) {
    constexpr double rt_s_per_rt_h = 60.0;
    const auto squared = [](const noise::Coefficient& c, double factor) {
        return c.resolved ? std::pow(factor * *c.value, 2) : 0.0;
    };
    // Variances of the terms as noise::shapes() has them, in (arcsec/s)^2, which are (deg/h)^2.
    noise::Shapes theta{};
    theta[noise::quantisation] = squared(fit.quantization_arcsec, 1.0 / tau0_s);
    theta[noise::angle_random_walk] = squared(fit.arw_deg_rt_h, 1.0 / units::deg_rt_h_per_arcsec_rt_s) / tau0_s;
    theta[noise::flicker] = squared(fit.bias_instability_deg_h, 1.0);
    theta[noise::rate_random_walk] = squared(fit.rrw_deg_h_rt_h, 1.0 / rt_s_per_rt_h) * tau0_s;
    std::vector<double> out;
    for (const double f : frequencies_hz) {
        const double x = f * tau0_s;
        const noise::Shapes shape = noise::shapes(x);
        double variance = 0.0;
        for (std::size_t i = 0; i < theta.size(); ++i) variance += theta[i] * shape[i];
        if (fit.correlated) {
            const double log_time = std::log(fit.correlated->correlation_time_s.value / tau0_s);
            const double sin2 = std::pow(std::sin(std::numbers::pi * x), 2);
            variance += std::pow(fit.correlated->rms_rate_deg_h.value, 2) *
                        noise::CorrelatedShape(log_time, fit.samples)(sin2).shape;
        }
        out.push_back(tau0_s * variance);
    }
    return out;
}

}  // namespace ringlock::stability
