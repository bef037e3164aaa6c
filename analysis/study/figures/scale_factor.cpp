#include "analysis/study/figures/scale_factor.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <vector>

#include "analysis/noise/ensemble.hpp"

namespace ringlock::study {

namespace {

constexpr double outside = 0.05;  // of all intervals
constexpr double ppm = 1e6;

struct Moments {
    double mean = 0.0;
    double sd = 0.0;
};

Moments moments(const std::vector<double>& values) {
    const auto n = static_cast<double>(values.size());
    Moments m;
    for (const double v : values) m.mean += v / n;
    double squares = 0.0;
    for (const double v : values) squares += (v - m.mean) * (v - m.mean);
    m.sd = std::sqrt(squares / (n - 1.0));
    return m;
}

SignedFigure mean_of(const std::vector<double>& values, double unit) {
    const Moments m = moments(values);
    const auto n = static_cast<double>(values.size());
    const double half = quantile(complement(boost::math::students_t(n - 1.0), 0.5 * outside)) * m.sd / std::sqrt(n);
    SignedFigure figure{m.mean * unit, (m.mean - half) * unit, (m.mean + half) * unit};
    if (figure.lo <= 0.0 && figure.hi >= 0.0) figure.mean.reset();
    return figure;
}

SizeFigure standard_deviation(double sd, double freedom, double unit) {
    const boost::math::chi_squared chi2(freedom);
    const auto end = [&](double p) { return sd * std::sqrt(freedom / quantile(chi2, p)) * unit; };
    return {sd * unit, end(1.0 - 0.5 * outside), end(0.5 * outside)};
}

/// Variance component of the slopes. The variance of the slopes over that which the scatter gives them, F, is
/// (1 + share) times Fisher's, share the component over the scatter's part.
SizeFigure beyond_noise(double slope_sd, double noise_sd, double freedom, double noise_freedom, double unit) {
    if (!(noise_sd > 0.0)) return standard_deviation(slope_sd, freedom, unit);
    const boost::math::fisher_f fisher(freedom, noise_freedom);
    const double f = slope_sd * slope_sd / (noise_sd * noise_sd);
    const auto component = [&](double p) {
        return noise_sd * std::sqrt(std::max(f / quantile(fisher, p) - 1.0, 0.0)) * unit;
    };
    SizeFigure figure;
    if (f > quantile(complement(fisher, outside))) {
        figure.value = noise_sd * std::sqrt(std::max(f - 1.0, 0.0)) * unit;
        figure.lo = component(1.0 - 0.5 * outside);
        figure.hi = component(0.5 * outside);
    } else {
        figure.hi = component(outside);
    }
    return figure;
}

/// The gyros' lines through their rate errors.
struct Lines {
    double centre = 0.0;          ///< mean of the rates
    double squares = 0.0;         ///< sum of squares of the rates about it
    std::vector<double> slopes;   ///< empty where there is no line
    std::vector<double> middles;  ///< values at the centre
};

Lines lines_through(std::span<const double> input_rates_deg_h, std::span<const double> errors_deg_h) {
    const std::size_t rates = input_rates_deg_h.size();
    Lines lines;
    if (rates < 3) return lines;
    const std::size_t gyros = errors_deg_h.size() / rates;
    const auto k = static_cast<double>(rates);
    for (const double x : input_rates_deg_h) lines.centre += x / k;
    for (const double x : input_rates_deg_h) lines.squares += (x - lines.centre) * (x - lines.centre);
    if (!(lines.squares > 0.0)) return lines;
    lines.slopes.assign(gyros, 0.0);
    lines.middles.assign(gyros, 0.0);
    for (std::size_t j = 0; j < rates; ++j) {
        for (std::size_t m = 0; m < gyros; ++m) {
            const double error = errors_deg_h[j * gyros + m];
            lines.slopes[m] += (input_rates_deg_h[j] - lines.centre) / lines.squares * error;
            lines.middles[m] += error / k;
        }
    }
    return lines;
}

}  // namespace

std::vector<double> scale_factor_errors_ppm(std::span<const double> input_rates_deg_h,
                                            std::span<const double> errors_deg_h) {
    std::vector<double> errors_ppm = lines_through(input_rates_deg_h, errors_deg_h).slopes;
    for (double& error : errors_ppm) error *= ppm;
    return errors_ppm;
}

std::optional<ScaleFactor> scale_factor(std::span<const double> input_rates_deg_h,
                                        std::span<const double> errors_deg_h) {
    const std::size_t rates = input_rates_deg_h.size();
    const std::size_t gyros = rates == 0 ? 0 : errors_deg_h.size() / rates;
    if (gyros < 2) return std::nullopt;
    const auto [centre, squares, slopes, middles] = lines_through(input_rates_deg_h, errors_deg_h);
    if (slopes.empty()) return std::nullopt;
    const auto k = static_cast<double>(rates);
    const auto n = static_cast<double>(gyros);
    ScaleFactor result;
    for (const double x : input_rates_deg_h) result.full_scale_deg_h = std::max(result.full_scale_deg_h, std::abs(x));
    std::vector<double> biases(gyros);
    for (std::size_t m = 0; m < gyros; ++m) biases[m] = middles[m] - slopes[m] * centre;

    // Deviations of each gyro from its line: the part that all gyros share at a rate, and the remainder.
    std::vector<double> largest(gyros, 0.0);
    double scatter = 0.0;
    const double allowance = quantile(complement(boost::math::students_t(n - 1.0), 0.5 * outside / k));
    SizeFigure& shared_figure = result.largest_deviation_deg_h;
    double largest_shared = -1.0;
    for (std::size_t j = 0; j < rates; ++j) {
        std::vector<double> deviations(gyros);
        for (std::size_t m = 0; m < gyros; ++m) {
            deviations[m] = errors_deg_h[j * gyros + m] - middles[m] - slopes[m] * (input_rates_deg_h[j] - centre);
            largest[m] = std::max(largest[m], std::abs(deviations[m]));
        }
        const Moments shared = moments(deviations);
        scatter += (n - 1.0) * shared.sd * shared.sd;
        const double size = std::abs(shared.mean);
        const double half = allowance * shared.sd / std::sqrt(n);
        shared_figure.lo = std::max(shared_figure.lo, size - half);
        shared_figure.hi = std::max(shared_figure.hi, size + half);
        if (size > largest_shared) {
            largest_shared = size;
            result.largest_deviation_at_deg_h = input_rates_deg_h[j];
        }
    }
    if (shared_figure.lo > 0.0) shared_figure.value = largest_shared;
    const double noise_freedom = (n - 1.0) * (k - 2.0);
    result.scatter_deg_h = std::sqrt(scatter / noise_freedom);

    const double slope_sd = moments(slopes).sd;
    const double noise_sd = result.scatter_deg_h / std::sqrt(squares);
    result.scale_factor_ppm = mean_of(slopes, ppm);
    result.repeatability_ppm = standard_deviation(slope_sd, n - 1.0, ppm);
    result.noise_ppm = noise_sd * ppm;
    result.beyond_noise_ppm = beyond_noise(slope_sd, noise_sd, n - 1.0, noise_freedom, ppm);
    result.bias_deg_h = mean_of(biases, 1.0);
    result.bias_spread_deg_h = moments(biases).sd;
    const double over_full_scale = ppm / result.full_scale_deg_h;
    result.nonlinearity_ppm = {std::nullopt, shared_figure.lo * over_full_scale, shared_figure.hi * over_full_scale};
    if (shared_figure.value) result.nonlinearity_ppm.value = *shared_figure.value * over_full_scale;
    const noise::Range range = noise::central_range(largest);
    result.gyro_deviation_deg_h = range.median;
    result.gyro_deviation_lo_deg_h = range.lo;
    result.gyro_deviation_hi_deg_h = range.hi;
    return result;
}

}  // namespace ringlock::study
