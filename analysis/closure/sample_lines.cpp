#include "analysis/closure/sample_lines.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "analysis/closure/sample_line_search.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

std::vector<std::vector<double>> line_columns(std::size_t size, double rate_hz, double hz, double drift_hz_per_s) {
    const auto phase = line_phase(size, rate_hz, hz, drift_hz_per_s);
    std::vector<std::vector<double>> columns(2, std::vector<double>(size));
    for (std::size_t i = 0; i < size; ++i) {
        columns[0][i] = std::cos(phase[i]);
        columns[1][i] = std::sin(phase[i]);
    }
    return columns;
}

std::vector<std::vector<double>> line_slopes(std::size_t size, double rate_hz, const SampleLine& line, double a,
                                             double b) {
    const auto phase = line_phase(size, rate_hz, line.hz, line.drift_hz_per_s);
    std::vector<std::vector<double>> slopes(line.drifts ? 2 : 1, std::vector<double>(size));
    for (std::size_t i = 0; i < size; ++i) {
        const double t = (static_cast<double>(i) - 0.5 * static_cast<double>(size - 1)) / rate_hz;
        const double turned = units::two_pi * t * (b * std::cos(phase[i]) - a * std::sin(phase[i]));
        slopes[0][i] = turned;
        if (line.drifts) slopes[1][i] = 0.5 * t * turned;
    }
    return slopes;
}

SampleLine refine_line(const SampleFit& fit, SampleLine line) {
    const std::size_t n = fit.series().size();
    const double rate_hz = fit.series().rate_hz;
    const double duration_s = static_cast<double>(n) / rate_hz;
    for (int round = 0; round < 6; ++round) {
        auto columns = line_columns(n, rate_hz, line.hz, line.drift_hz_per_s);
        const auto score = fit.score(columns);
        if (score.rank < 2) return line;
        line.chi2 = score.chi2;
        for (auto& slope : line_slopes(n, rate_hz, line, score.value[0], score.value[1])) {
            columns.push_back(std::move(slope));
        }
        const auto all = fit.score(columns);
        const double off_hz = std::clamp(all.value[2], -0.3 / duration_s, 0.3 / duration_s);
        const double most = 2.0 / (duration_s * duration_s);
        const double off_drift = line.drifts ? std::clamp(all.value[3], -most, most) : 0.0;
        SampleLine next = line;
        next.hz += off_hz;
        next.drift_hz_per_s += off_drift;
        next.chi2 = fit.score(line_columns(n, rate_hz, next.hz, next.drift_hz_per_s)).chi2;
        if (!(next.chi2 > line.chi2)) break;
        const double gained = next.chi2 - line.chi2;
        line = next;
        if (gained < 1e-3) break;
    }
    return line;
}

SampleFit refine_lines(const SampleSeries& series, SampleFit fit, const Rows& rows) {
    const std::size_t n = series.size();
    for (int round = 0; round < 2; ++round) {
        SampleModel model = fit.model();
        bool any = false;
        for (std::size_t k = 0; k + 1 < model.columns.size(); ++k) {
            SampleColumn& cosine = model.columns[k];
            if (cosine.name != "cosine") continue;
            any = true;
            SampleLine line{cosine.hz, cosine.drift_hz_per_s, cosine.drifts};
            const auto score =
                fit.score(line_slopes(n, series.rate_hz, line, cosine.value, model.columns[k + 1].value));
            // Where it cannot be said better than within a cycle over the record there is nothing to be mended.
            const double duration_s = series.interval_s * static_cast<double>(n);
            cosine.hz += std::clamp(score.value[0], -0.3 / duration_s, 0.3 / duration_s);
            const double most = 2.0 / (duration_s * duration_s);
            if (cosine.drifts) cosine.drift_hz_per_s += std::clamp(score.value[1], -most, most);
            auto columns = line_columns(n, series.rate_hz, cosine.hz, cosine.drift_hz_per_s);
            cosine.series = std::make_shared<const std::vector<double>>(std::move(columns[0]));
            model.columns[k + 1].series = std::make_shared<const std::vector<double>>(std::move(columns[1]));
        }
        if (!any) break;
        fit = SampleFit(series, std::move(model), rows, SampleFit::Noise::near);
    }
    return fit;
}

}  // namespace ringlock::closure
