#include "analysis/noise/decomposition.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/noise/model/lost_information.hpp"

namespace ringlock::noise {
namespace {

constexpr std::size_t most_lines = 3;
constexpr std::size_t fewest_samples = 128;  // below, the deviance is not chi-squared enough for its tail

const Maximum& maximum(const Decomposition& d, double significance) {
    return d.markov.supported(significance) ? d.markov.best : d.five;
}

void fit_variances(Decomposition& d) {
    const Likelihood likelihood(d.noise);
    d.five = likelihood.maximise(model_of(five_terms));
    d.markov = d.noise.samples < fewest_samples ? Markov{} : find_markov(likelihood, d.five);
    if (d.noise.lost != nullptr) {
        d.markov.evidence /= d.noise.lost->inflation(model_of(five_terms | correlated_bit), correlated);
    }
}

/// Lines and variances in turns.
void settle(Decomposition& d, const LineFinder& finder, const Spectrum& record, double significance) {
    constexpr int most_rounds = 8;
    constexpr double enough = 0.01;  // of deviance
    double last = maximum(d, significance).deviance;
    for (int round = 0; round < most_rounds; ++round) {
        d.noise.z = record.z;
        for (const Line& line : d.lines) finder.add(line, -1.0, d.noise.z);
        d.noise.sum_bins();
        fit_variances(d);
        const double deviance = maximum(d, significance).deviance;
        if (round > 0 && std::abs(deviance - last) < enough) return;
        last = deviance;
        const std::vector<double> variance = coefficient_variances(d.noise, maximum(d, significance));
        std::vector<double> rest = residual(d.noise, maximum(d, significance));
        for (Line& line : d.lines) {
            finder.add(line, 1.0, rest);
            finder.refine(line, rest, variance);
            finder.add(line, -1.0, rest);
        }
    }
}

}  // namespace

Decomposition decompose(Spectrum spectrum, double significance) {
    Decomposition out;
    out.noise = spectrum;
    fit_variances(out);
    if (spectrum.samples < fewest_samples) return out;
    const LineFinder finder(spectrum.samples);
    const double price = line_price(spectrum.samples, significance);
    while (out.lines.size() < most_lines) {
        const std::vector<double> variance = coefficient_variances(out.noise, maximum(out, significance));
        const std::vector<double> rest = residual(out.noise, maximum(out, significance));
        std::optional<Line> line = finder.strongest(rest, variance, out.lines);
        // A line that is there has also raised the variances with which it is compared.
        if (!line || line->gain < 0.5 * price) break;
        finder.refine(*line, rest, variance);
        Decomposition with = out;
        with.lines.push_back(*line);
        settle(with, finder, spectrum, significance);
        const double rise = maximum(out, significance).deviance - maximum(with, significance).deviance;
        if (!(rise >= price)) break;
        with.evidence.push_back(rise);
        out = std::move(with);
    }
    return out;
}

}  // namespace ringlock::noise
