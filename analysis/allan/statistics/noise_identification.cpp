#include "analysis/allan/statistics/noise_identification.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace ringlock::allan {
namespace {

/// Removes the least-squares parabola, by projection on orthogonal polynomials of the centred index.
void remove_parabola(std::vector<double>& x) {
    const double n = static_cast<double>(x.size());
    const double middle = 0.5 * (n - 1.0);
    const double mean_square = (n * n - 1.0) / 12.0;
    double sum = 0.0;
    double dot1 = 0.0;
    double dot2 = 0.0;
    double norm1 = 0.0;
    double norm2 = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        const double p1 = static_cast<double>(i) - middle;
        const double p2 = p1 * p1 - mean_square;
        sum += x[i];
        dot1 += p1 * x[i];
        dot2 += p2 * x[i];
        norm1 += p1 * p1;
        norm2 += p2 * p2;
    }
    for (std::size_t i = 0; i < x.size(); ++i) {
        const double p1 = static_cast<double>(i) - middle;
        const double p2 = p1 * p1 - mean_square;
        x[i] -= sum / n + dot1 / norm1 * p1 + dot2 / norm2 * p2;
    }
}

std::optional<double> lag1_autocorrelation(const std::vector<double>& x) {
    double mean = 0.0;
    for (const double v : x) mean += v;
    mean /= static_cast<double>(x.size());
    double power = 0.0;
    double lagged = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        power += (x[i] - mean) * (x[i] - mean);
        if (i > 0) lagged += (x[i] - mean) * (x[i - 1] - mean);
    }
    if (!(power > 0.0)) return std::nullopt;
    return lagged / power;
}

}  // namespace

std::optional<double> noise_exponent(std::span<const double> phase, std::int64_t m, int most_differences) {
    constexpr std::size_t most_points = std::size_t{1} << 17;
    const auto step = static_cast<std::size_t>(m);
    const std::size_t points = phase.empty() ? 0 : (phase.size() - 1) / step + 1;
    const std::size_t taken = std::min(points, most_points);
    std::vector<double> x(taken);
    const std::size_t first = (points - taken) / 2;
    for (std::size_t i = 0; i < taken; ++i) x[i] = phase[(first + i) * step];
    if (static_cast<std::int64_t>(x.size()) < noise_identification_points) return std::nullopt;
    remove_parabola(x);
    for (int d = 0;; ++d) {
        const std::optional<double> r = lag1_autocorrelation(x);
        if (!r) return std::nullopt;
        const double rho = *r / (1.0 + *r);
        if (rho < 0.25 || d == most_differences) return 2.0 - 2.0 * (d + rho);
        for (std::size_t i = 0; i + 1 < x.size(); ++i) x[i] = x[i + 1] - x[i];
        x.pop_back();
    }
}

std::optional<double> pooled_noise_exponent(std::span<const double> phase, std::int64_t m, int most_differences) {
    constexpr double many_points = 200.0;
    constexpr int most_octaves = 3;
    constexpr double most_deviations = 2.5;
    constexpr double least_of_phase_noise = 0.5;
    const auto points_at = [&](std::int64_t k) { return static_cast<double>((std::ssize(phase) - 1) / k + 1); };
    const std::optional<double> here = noise_exponent(phase, m, most_differences);
    if (!here || m == 1 || points_at(m) > many_points) return here;
    double mean = *here;
    double points = points_at(m);
    double most = mean;
    std::int64_t k = m / 2;
    for (int octave = 1; octave <= most_octaves && k >= 1; ++octave, k /= 2) {
        const std::optional<double> below = noise_exponent(phase, k, most_differences);
        if (!below) break;
        if (octave == 1) most = std::max(*below, std::nextafter(least_of_phase_noise, 0.0));
        const double more = points_at(k);
        const double deviation = (*below > -0.5 ? 2.0 : 2.8) * std::sqrt(1.0 / more + 1.0 / points);
        if (std::abs(*below - mean) > most_deviations * deviation) break;
        mean = (mean * points + *below * more) / (points + more);
        points += more;
    }
    return std::min(mean, most);
}

int nearest_noise(double exponent, int most_differences) {
    constexpr double red_shift = 0.22;
    const double shifted = exponent < -1.0 ? exponent + red_shift : exponent;
    return static_cast<int>(std::lround(std::clamp(shifted, 2.0 - 2.0 * most_differences, 2.0)));
}

}  // namespace ringlock::allan
