#include "analysis/allan/octave_deviation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/allan/interval.hpp"
#include "analysis/allan/statistics/degrees_of_freedom.hpp"
#include "analysis/allan/statistics/noise_identification.hpp"
#include "engine/core/error.hpp"

namespace ringlock::allan {
namespace {

/// The exponent of the noise whose Allan variance is proportional to m^mu.
int exponent(double mu, int differences) {
    if (mu < -1.5) return 2;
    return std::clamp(-1 - static_cast<int>(std::lround(mu)), 2 - 2 * differences, 0);
}

double variance_of(const OctaveMean& mean, int differences, double tau0_s) {
    const double tau = static_cast<double>(mean.m) * tau0_s;
    return mean.mean_square / ((differences == 3 ? 6.0 : 2.0) * tau * tau);
}

}  // namespace

Point stream_point(const OctaveMean& mean, int alpha, int differences, std::int64_t samples, double tau0_s,
                   double confidence) {
    check_deviation_input(tau0_s, confidence);
    Point p;
    p.m = mean.m;
    p.tau_s = static_cast<double>(p.m) * tau0_s;
    p.dev = std::sqrt(variance_of(mean, differences, tau0_s));
    p.terms = mean.terms;
    p.alpha = alpha;
    // The degrees of freedom need a whole number of strides in tau: for other factors those of the next smaller factor
    // with a whole number are taken.
    const std::int64_t stride = std::max<std::int64_t>(1, p.m / OctaveStream::starts_per_tau);
    const EstimatorShape shape{.differences = differences, .starts_per_tau = p.m / stride};
    const std::int64_t m = shape.starts_per_tau * stride;
    // A record with gaps has the degrees of freedom of one without gaps that has as many terms.
    const std::int64_t alike = std::min(samples, 1 + m * differences + (p.terms - 1) * stride + stride - 1);
    p.edf = degrees_of_freedom(shape, p.alpha, m, alike);
    set_interval(p, confidence);
    return p;
}

std::vector<int> noise_of_octaves(const std::vector<double>& variances, std::int64_t samples, int differences) {
    constexpr std::int64_t sure = 100;
    std::vector<int> alpha(variances.size(), 0);
    int before = 0;  // found an octave below
    for (std::size_t i = 0; i < variances.size(); ++i) {
        const std::int64_t taus = (samples - 1) >> i;
        const std::size_t below = i == 0 ? i : i - 1;
        const std::size_t above = std::min(i + 1, variances.size() - 1);
        const bool tells = taus >= noise_identification_points - 1 && below < above && variances[below] > 0.0 &&
                           variances[above] > 0.0;
        if (!tells) {
            alpha[i] = i == 0 ? 0 : alpha[i - 1];
            continue;
        }
        const double octaves = static_cast<double>(above - below);
        const int found = exponent(std::log2(variances[above] / variances[below]) / octaves, differences);
        alpha[i] = i == 0 || taus >= sure ? found : std::min(found, before);
        before = found;
    }
    return alpha;
}

std::vector<Point> octave_points(const std::vector<OctaveMean>& octaves, int differences, std::int64_t samples,
                                 double tau0_s, double confidence) {
    check_deviation_input(tau0_s, confidence);
    std::vector<double> variances;
    for (const OctaveMean& octave : octaves) variances.push_back(variance_of(octave, differences, tau0_s));
    const std::vector<int> alpha = noise_of_octaves(variances, samples, differences);

    std::vector<Point> out;
    for (std::size_t i = 0; i < octaves.size(); ++i) {
        out.push_back(stream_point(octaves[i], alpha[i], differences, samples, tau0_s, confidence));
    }
    return out;
}

std::vector<Point> deviation(const OctaveStream& stream, std::size_t lane, double unit_per_count, double tau0_s,
                             double confidence) {
    if (!(unit_per_count > 0.0) || !std::isfinite(unit_per_count)) {
        throw InputError(fmt::format("unit of a count {}: must be a positive number", unit_per_count));
    }
    std::vector<OctaveMean> octaves;
    for (const Octave& octave : stream.octaves(lane)) {
        const double mean_square = octave.sum.rounded() / static_cast<double>(octave.terms);
        octaves.push_back({octave.m, mean_square * unit_per_count * unit_per_count, octave.terms});
    }
    return octave_points(octaves, 2, stream.samples(), tau0_s, confidence);
}

}  // namespace ringlock::allan
