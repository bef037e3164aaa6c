#include "analysis/closure/sample_lines.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

SampleLine refined_from(const SampleFit& fit, SampleLine line) {
    const double duration_s = static_cast<double>(fit.series().size()) * fit.series().interval_s;
    for (int round = 0; round < 6; ++round) {
        auto columns = fit.line(line.hz, line.drift_hz_per_s);
        const auto score = fit.score(columns);
        if (score.rank < 2) return line;
        line.chi2 = score.chi2;
        for (auto& slope : line_slopes(fit, line, score.value[0], score.value[1])) columns.push_back(std::move(slope));
        const auto all = fit.score(columns);
        const double off_hz = std::clamp(all.value[2], -0.3 / duration_s, 0.3 / duration_s);
        const double most = 2.0 / (duration_s * duration_s);
        const double off_drift = line.drifts ? std::clamp(all.value[3], -most, most) : 0.0;
        SampleLine next = line;
        next.hz += off_hz;
        next.drift_hz_per_s += off_drift;
        next.chi2 = fit.score(fit.line(next.hz, next.drift_hz_per_s)).chi2;
        if (!(next.chi2 > line.chi2)) break;
        const double gained = next.chi2 - line.chi2;
        line = next;
        if (gained < 1e-3) break;
    }
    return line;
}

}  // namespace

bool is_line(const std::string& effect) { return effect == "dither_residue" || effect == "base_vibration"; }

std::vector<std::vector<double>> line_slopes(const SampleFit& fit, const SampleLine& line, double a, double b) {
    const double duration_s = static_cast<double>(fit.series().size()) * fit.series().interval_s;
    // So small a part of a cycle at either end of the record that the next term does not matter.
    constexpr double part = 1e-4;
    const auto by = [&](double off_hz, double off_drift) {
        const auto more = fit.line(line.hz + off_hz, line.drift_hz_per_s + off_drift);
        const auto less = fit.line(line.hz - off_hz, line.drift_hz_per_s - off_drift);
        const double per = 0.5 / (off_hz + off_drift);
        std::vector<double> slope(more[0].size());
        for (std::size_t i = 0; i < slope.size(); ++i) {
            slope[i] = per * (a * (more[0][i] - less[0][i]) + b * (more[1][i] - less[1][i]));
        }
        return slope;
    };
    std::vector<std::vector<double>> slopes{by(part / duration_s, 0.0)};
    if (line.drifts) slopes.push_back(by(0.0, part / (duration_s * duration_s)));
    return slopes;
}

void set_line(SampleModel& model, std::size_t cosine, const SampleSeries& series, const SampleLine& line) {
    auto columns = line_columns(series.size(), series.rate_hz, line.hz, line.drift_hz_per_s);
    model.columns[cosine].series = std::make_shared<const std::vector<double>>(std::move(columns[0]));
    model.columns[cosine + 1].series = std::make_shared<const std::vector<double>>(std::move(columns[1]));
    for (std::size_t k = cosine; k < cosine + 2; ++k) {
        model.columns[k].hz = line.hz;
        model.columns[k].drift_hz_per_s = line.drift_hz_per_s;
        model.columns[k].drifts = line.drifts;
    }
}

SampleLine refine_line(const SampleFit& fit, const SampleLine& shown) {
    SampleLine best = shown;
    best.chi2 = -1.0;
    for (const Alias& of : of_source(shown.hz, fit.series().rate_hz, fit.model().noise.from_hz)) {
        SampleLine line = shown;
        line.hz = of.hz;
        if (of.folded) line.drift_hz_per_s = -line.drift_hz_per_s;
        line = refined_from(fit, line);
        if (line.chi2 > best.chi2) best = line;
    }
    return best;
}

bool scatters(const SampleFit& fit, std::vector<double> innovations, const FoundLines& found, const SampleLine& line) {
    constexpr double much = 60.0;
    constexpr double near_hz = 1.0;
    if (!(found.scattered > line.chi2 + much)) return false;
    // A strong line raises the level about it, which powers are over: more than about its peaks in pieces.
    const auto columns = fit.line(line.hz, line.drift_hz_per_s);
    const auto score = fit.score(columns);
    for (std::size_t c = 0; c < columns.size(); ++c) {
        const auto white = fit.filter().apply(columns[c]);
        for (std::size_t i = 0; i < white.size(); ++i) {
            if (innovations[i] != 0.0) innovations[i] -= score.value[c] * white[i];
        }
    }
    const FoundLines left = find_lines(innovations, fit.series().rate_hz);
    const bool same = std::abs(left.scattered_hz - found.scattered_hz) < near_hz;
    return same && left.scattered > found.scattered / 3.0 + much;
}

SampleModel with_wandering_line(const SampleFit& fit, const FoundLines& found, const Rows& rows,
                                const std::string& effect, int step) {
    const SampleSeries& series = fit.series();
    double squares = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (!rows[i]) continue;
        squares += fit.innovations()[i] * fit.innovations()[i];
        count += 1.0;
    }
    // Power over the level is chi-squared of two a piece; the angle's increments have 2 sin of it.
    const double sd = fit.sd(0) * std::sqrt(squares / count);
    const double gain = 2.0 * std::sin(units::pi * found.scattered_hz / series.rate_hz);
    const double rms = sd * std::sqrt(found.scattered / count) / std::max(gain, 1e-6);
    const double duration_s = static_cast<double>(series.size()) * series.interval_s;
    SampleModel model = fit.model();
    model.noise.resonances.push_back({rms, found.scattered_hz, 64.0 / duration_s});
    model.resonances.push_back(effect);
    model.resonance_steps.push_back(step);
    return model;
}

SampleFit refine_lines(SampleFit fit, const Rows& rows) {
    const SampleSeries& series = fit.series();
    const double duration_s = series.interval_s * static_cast<double>(series.size());
    for (int round = 0; round < 2; ++round) {
        SampleModel model = fit.model();
        bool any = false;
        for (std::size_t k = 0; k + 1 < model.columns.size(); ++k) {
            const SampleColumn& cosine = model.columns[k];
            if (cosine.name != "cosine") continue;
            any = true;
            SampleLine line{cosine.hz, cosine.drift_hz_per_s, cosine.drifts};
            const auto score = fit.score(line_slopes(fit, line, cosine.value, model.columns[k + 1].value));
            // Where it cannot be said better than within a cycle over the record there is nothing to be mended.
            line.hz += std::clamp(score.value[0], -0.3 / duration_s, 0.3 / duration_s);
            const double most = 2.0 / (duration_s * duration_s);
            if (line.drifts) line.drift_hz_per_s += std::clamp(score.value[1], -most, most);
            set_line(model, k, series, line);
        }
        if (!any) break;
        fit = SampleFit(series, std::move(model), rows, SampleFit::Noise::near);
    }
    return fit;
}

}  // namespace ringlock::closure
