#include "analysis/allan/octave_deviation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/allan/degrees_of_freedom.hpp"
#include "analysis/allan/interval.hpp"
#include "analysis/allan/noise_identification.hpp"
#include "engine/core/error.hpp"

namespace ringlock::allan {
namespace {

/// The exponent of the noise whose Allan variance goes as m^mu.
int exponent(double mu) {
    if (mu < -1.5) return 2;
    return std::clamp(-1 - static_cast<int>(std::lround(mu)), -2, 0);
}

}  // namespace

std::vector<int> noise_of_octaves(const std::vector<double>& variances, std::int64_t samples) {
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
        const int found = exponent(std::log2(variances[above] / variances[below]) / octaves);
        alpha[i] = i == 0 || taus >= sure ? found : std::min(found, before);
        before = found;
    }
    return alpha;
}

std::vector<Point> deviation(const OctaveStream& stream, std::size_t lane, double unit_per_count, double tau0_s,
                             double confidence) {
    check_deviation_input(tau0_s, confidence);
    if (!(unit_per_count > 0.0) || !std::isfinite(unit_per_count)) {
        throw InputError(fmt::format("unit of a count {}: must be a positive number", unit_per_count));
    }
    constexpr EstimatorShape shape{.starts_per_tau = OctaveStream::starts_per_tau};
    const std::vector<Octave> octaves = stream.octaves(lane);
    std::vector<double> variances;
    for (const Octave& octave : octaves) {
        const auto m = static_cast<double>(octave.m);
        variances.push_back(octave.sum.rounded() / (2.0 * static_cast<double>(octave.terms)) / (m * m));
    }
    const std::vector<int> alpha = noise_of_octaves(variances, stream.samples());

    std::vector<Point> out;
    for (std::size_t i = 0; i < octaves.size(); ++i) {
        Point p;
        p.m = octaves[i].m;
        p.tau_s = static_cast<double>(p.m) * tau0_s;
        p.dev = std::sqrt(variances[i]) * (unit_per_count / tau0_s);
        p.terms = octaves[i].terms;
        p.alpha = alpha[i];
        p.edf = degrees_of_freedom(shape, p.alpha, p.m, stream.samples());
        set_interval(p, confidence);
        out.push_back(p);
    }
    return out;
}

}  // namespace ringlock::allan
