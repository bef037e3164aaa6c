#include "analysis/closure/samples/residual/tests.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/residual/templates.hpp"
#include "analysis/closure/stats/normality.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/stats/two_levels.hpp"
#include "analysis/closure/stats/whiteness.hpp"

namespace ringlock::closure {

namespace {

void test_correlation(const SampleFit& fit, SampleResidualTests& tests) {
    tests.push_back({correlations_of(fit.innovations(), fit.informative())
                         .test(Where::time, "correlation with the 24 samples before")});
}

void test_spectrum(const SampleFit& fit, SampleResidualTests& tests) {
    const std::size_t n = fit.innovations().size();
    std::vector<double> e(n, 0.0);
    double count = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        if (!fit.informative()[i]) continue;
        e[i] = fit.innovations()[i];
        count += 1.0;
    }
    std::size_t padded = 1;
    while (padded < n) padded *= 2;
    padded *= 2;
    const auto power = periodogram(e, padded);
    double square = 0.0;
    for (const double x : e) square += x * x;
    // Independent frequencies of the rows that count, per bin
    const double independent = count / static_cast<double>(padded);
    double chi2 = 0.0;
    double worst = 0.0;
    double worst_ratio = 1.0;
    double worst_hz = 0.0;
    int bands = 0;
    // Bands that double from the lowest frequency on, then 32 bands of equal width.
    double from = 1.0 / independent;
    const double widest = static_cast<double>(power.size()) / 32.0;
    while (from < static_cast<double>(power.size()) - 1.0) {
        const double to = std::min(static_cast<double>(power.size()), std::min(2.0 * from, from + widest));
        const auto a = static_cast<std::size_t>(from);
        const auto b = static_cast<std::size_t>(to);
        from = to;
        if (b <= a + 1) continue;
        const double ratio = std::accumulate(power.begin() + static_cast<std::ptrdiff_t>(a),
                                             power.begin() + static_cast<std::ptrdiff_t>(b), 0.0) /
                             (static_cast<double>(b - a) * square);
        const double freedom = 2.0 * static_cast<double>(b - a) * independent;
        // Wilson and Hilferty: the cube root of chi-squared is nearly normal.
        const double z = (std::cbrt(ratio) - 1.0 + 2.0 / (9.0 * freedom)) / std::sqrt(2.0 / (9.0 * freedom));
        chi2 += z * z;
        ++bands;
        if (std::abs(z) > worst) {
            worst = std::abs(z);
            worst_ratio = ratio;
            worst_hz = 0.5 * static_cast<double>(a + b) * fit.series().rate_hz / static_cast<double>(padded);
        }
    }
    tests.push_back({{Where::frequency, "spectrum in bands", chi2_tail(chi2, bands),
                      fmt::format("most at {:.4g} Hz, {:.3g} times the mean", worst_hz, worst_ratio)}});
    const FoundLines lines = find_lines(e, fit.series().rate_hz);
    const FoundLine line = lines.likeliest();
    const double cost = 3.0 + std::log(line.look_elsewhere);
    // A scattered line explains as much as a model that follows it from stretch to stretch.
    const double gain = 0.5 * std::max(line.chi2, lines.scattered);
    double p = line.p_value;
    bool coherent = line.chi2 >= lines.scattered;
    if (p < options.samples.residual.line_p) {
        const FrequencyTrack shown = line.drift_hz_per_s != 0.0
                                         ? FrequencyTrack::even(line.frequency_hz, line.drift_hz_per_s)
                                         : FrequencyTrack::still(line.frequency_hz);
        const SampleLine refined = refine_line(fit, shown);
        coherent = !scatters(fit, e, lines, refined);
        // The level about a line is itself random, so that the p-value of the regression counts as well.
        if (coherent) p = std::max(p, of_several(chi2_tail(refined.chi2, 2), line.look_elsewhere));
    }
    SampleResidualTest test{
        {Where::frequency, "lines, still and drifting", p,
         fmt::format("at {:.6g} Hz", coherent ? line.frequency_hz : lines.scattered_hz), gain - cost},
        cost};
    test.hz = coherent ? line.frequency_hz : lines.scattered_hz;
    if (coherent) {
        test.columns = [&fit, line] {
            const Alias of = of_source(line.frequency_hz, fit.series().rate_hz, fit.model().noise.from_hz).front();
            return fit.line(FrequencyTrack::even(line.frequency_hz, line.drift_hz_per_s).shown_at(of.hz, of.folded));
        };
    }
    if (!coherent) {
        // Power over the level in pieces is no likelihood: for a strong line it is far more. The model of a scattered
        // line is a resonance.
        const double squares = std::inner_product(e.begin(), e.end(), e.begin(), 0.0);
        const auto rows = static_cast<double>(std::count_if(e.begin(), e.end(), [](double x) { return x != 0.0; }));
        const double share = std::min(lines.scattered_squares / std::max(squares, 1e-300), 1.0 - 1e-9);
        test.by_variance = std::min(gain, -0.5 * rows * std::log1p(-share)) - cost;
        test.refitted = [&fit, lines, cost](double) {
            const SampleFit with(fit.series(), with_wandering_line(fit, lines, fit.rows(), nullptr, -1), fit.rows());
            return with.gain_over(fit) - cost;
        };
    }
    tests.push_back(std::move(test));
}

/// Variation of a line over the record, by its amplitudes in stretches. `cosine` is the column of its cosine.
struct OverTime {
    double p_value = 1.0;  ///< by chance
    double power = 0.0;    ///< chi-squared of the line
    double off = 0.0;      ///< chi-squared of the stretches in addition to the line, less its expectation by chance
};
OverTime line_over_time(const SampleFit& fit, std::size_t cosine) {
    const std::size_t stretches = options.samples.residual.line_stretches;
    const std::size_t n = fit.innovations().size();
    const auto& x = fit.whitened()[cosine];
    const auto& y = fit.whitened()[cosine + 1];
    const double a = fit.model().columns[cosine].value;
    const double b = fit.model().columns[cosine + 1].value;
    double power = 0.0;
    double chi2 = 0.0;
    int freedom = -2;
    for (std::size_t s = 0; s < stretches; ++s) {
        double xx = 0.0, xy = 0.0, yy = 0.0, xe = 0.0, ye = 0.0;
        for (std::size_t i = n * s / stretches; i < n * (s + 1) / stretches; ++i) {
            if (!fit.rows()[i]) continue;
            const double e = fit.innovations()[i];
            xx += x[i] * x[i];
            xy += x[i] * y[i];
            yy += y[i] * y[i];
            xe += x[i] * e;
            ye += y[i] * e;
        }
        const double det = xx * yy - xy * xy;
        if (!(det > 1e-6 * xx * yy)) continue;
        power += a * a * xx + 2.0 * a * b * xy + b * b * yy;
        chi2 += (yy * xe * xe - 2.0 * xy * xe * ye + xx * ye * ye) / det;
        freedom += 2;
    }
    if (freedom <= 0) return {1.0, power, 0.0};
    return {chi2_tail(chi2, freedom), power, chi2 - freedom};
}

void test_lines(const SampleFit& fit, SampleResidualTests& tests) {
    const auto& columns = fit.model().columns;
    const auto lines = std::count_if(columns.begin(), columns.end(), [](const auto& c) { return c.name == "cosine"; });
    if (lines == 0) return;
    tests.push_back({{Where::amplitude, "amplitude and phase of the lines over time", unsteady_line(fit).p_value, ""}});
}

}  // namespace

UnsteadyLine unsteady_line(const SampleFit& fit) {
    UnsteadyLine least;
    double power = 0.0;
    double lines = 0.0;
    const auto& columns = fit.model().columns;
    for (std::size_t c = 0; c + 1 < columns.size(); ++c) {
        if (columns[c].name != "cosine") continue;
        lines += 1.0;
        const OverTime found = line_over_time(fit, c);
        if (least.step >= 0 && found.p_value >= least.p_value) continue;
        power = found.power;
        least = {.step = columns[c].step,
                 .hz = columns[c].track.hz,
                 .p_value = found.p_value,
                 .off = found.off / std::max(power, 1e-300)};
    }
    least.p_value = of_several(least.p_value, std::max(lines, 1.0));
    if (least.step < 0) return least;
    std::vector<double> e(fit.innovations().size(), 0.0);
    for (std::size_t i = 0; i < e.size(); ++i) {
        if (fit.informative()[i]) e[i] = fit.innovations()[i];
    }
    const FoundLines left = find_lines(e, fit.series().rate_hz);
    const FoundLine line = left.likeliest();
    const double hz = line.chi2 >= left.scattered ? line.frequency_hz : left.scattered_hz;
    if (line.p_value < options.level_of_residual &&
        std::abs(hz - alias(least.hz, fit.series().rate_hz).hz) < options.samples.lines.adjacent_hz) {
        least.adjacent = std::max(line.chi2, left.scattered) / std::max(power, 1e-300);
    }
    return least;
}

SampleFit fit_with_columns(const SampleFit& fit, const SampleResidualTest& test) {
    SampleModel model = fit.model();
    for (auto& column : test.columns()) {
        model.columns.push_back({nullptr, "view", std::make_shared<const std::vector<double>>(std::move(column))});
        model.columns.back().as_recorded = test.hz.has_value();
    }
    return {fit.series(), std::move(model), fit.rows(), SampleFit::Noise::near};
}

double refitted_evidence(const SampleFit& fit, const SampleResidualTest& test) {
    return fit_with_columns(fit, test).gain_over(fit) - test.cost;
}

std::vector<SampleResidualTest> test_residual(const SampleFit& fit, double lattice_arcsec) {
    SampleResidualTests tests;
    test_correlation(fit, tests);
    test_spectrum(fit, tests);
    test_sizes(fit, lattice_arcsec, tests);
    test_followed(fit, tests);
    test_rate_patterns(fit, tests);
    test_lines(fit, tests);
    if (!fit.series().witnesses.empty()) {
        const FoundWitness witness = find_witness(fit.innovations(), fit.informative(), fit.series());
        if (witness.lags > 0 && !witness.name.empty()) {
            tests.push_back(
                {{Where::frequency, "witnesses at lags up to a quarter of a second", witness.p_value, witness.name}});
        }
    }
    return tests;
}

}  // namespace ringlock::closure
