#include "analysis/closure/samples/fit/lines.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "analysis/closure/options.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Limits a step of the coefficients to the range in which the linearisation holds.
void step_path(FrequencyTrack& track, const Eigen::VectorXd& off, double duration_s) {
    if (track.free <= 2) {
        const double most = 2.0 / (duration_s * duration_s);
        track.hz += std::clamp(off[0], -0.3 / duration_s, 0.3 / duration_s);
        if (track.free == 2) track.drifts[0] += std::clamp(off[1], -most, most);
        return;
    }
    // Coefficients of a polynomial compensate each other: all have the same factor.
    constexpr double most_cycles = 0.3;
    constexpr int positions = 64;
    double share = 1.0;
    FrequencyTrack step;
    for (std::size_t k = 0; k < track.free; ++k) step.coefficient(k) = off[static_cast<Eigen::Index>(k)];
    for (int i = -positions; i <= positions; ++i) {
        const double turns = std::abs(step.turns(0.5 * duration_s * i / positions));
        if (share * turns > most_cycles) share = most_cycles / turns;
    }
    for (std::size_t k = 0; k < track.free; ++k) track.coefficient(k) += share * step.coefficient(k);
}

SampleLine refined_from(const SampleFit& fit, SampleLine line) {
    const double duration_s = static_cast<double>(fit.series().size()) * fit.series().interval_s;
    const int most = line.track.free > 2 ? 20 : 6;
    for (int round = 0; round < most; ++round) {
        auto columns = fit.line(line.track);
        const auto score = fit.score(columns);
        if (score.rank < 2) return line;
        line.chi2 = score.chi2;
        for (auto& slope : line_slopes(fit, line.track, score.value[0], score.value[1])) {
            columns.push_back(std::move(slope));
        }
        const auto all = fit.score(columns);
        SampleLine next = line;
        step_path(next.track, Eigen::VectorXd::Map(&all.value[2], static_cast<Eigen::Index>(line.track.free)),
                  duration_s);
        next.chi2 = fit.score(fit.line(next.track)).chi2;
        if (!(next.chi2 > line.chi2)) break;
        const double gained = next.chi2 - line.chi2;
        line = next;
        if (gained < 1e-3) break;
    }
    return line;
}

}  // namespace

std::vector<std::vector<double>> line_slopes(const SampleFit& fit, const FrequencyTrack& track, double a, double b) {
    const double duration_s = static_cast<double>(fit.series().size()) * fit.series().interval_s;
    // So small a part of a cycle at either end of the record that the next order does not matter.
    constexpr double part = 1e-4;
    std::vector<std::vector<double>> slopes;
    for (std::size_t k = 0; k < track.free; ++k) {
        const double off = part * FrequencyTrack::a_cycle(k, duration_s);
        FrequencyTrack shifted = track;
        shifted.coefficient(k) += off;
        const auto more = fit.line(shifted);
        shifted.coefficient(k) -= 2.0 * off;
        const auto less = fit.line(shifted);
        std::vector<double>& slope = slopes.emplace_back(more[0].size());
        for (std::size_t i = 0; i < slope.size(); ++i) {
            slope[i] = 0.5 / off * (a * (more[0][i] - less[0][i]) + b * (more[1][i] - less[1][i]));
        }
    }
    return slopes;
}

void set_line(SampleModel& model, std::size_t cosine, const SampleSeries& series, const FrequencyTrack& track) {
    auto columns = line_columns(series.size(), series.rate_hz, track);
    for (std::size_t k = 0; k < 2; ++k) {
        model.columns[cosine + k].series = std::make_shared<const std::vector<double>>(std::move(columns[k]));
        model.columns[cosine + k].track = track;
    }
}

SampleLine refine_line(const SampleFit& fit, const FrequencyTrack& shown) {
    SampleLine best{shown, -1.0};
    for (const Alias& of : of_source(shown.hz, fit.series().rate_hz, fit.model().noise.from_hz)) {
        const SampleLine line = refined_from(fit, {shown.shown_at(of.hz, of.folded)});
        if (line.chi2 > best.chi2) best = line;
    }
    return best;
}

bool scatters(const SampleFit& fit, std::vector<double> innovations, const FoundLines& found, const SampleLine& line) {
    const SampleLineOptions& lines = options.samples.lines;
    if (!(found.scattered > line.chi2 + lines.much_scattered)) return false;
    // A strong line raises the level about it, over which powers are measured, and hides others near it. The residual
    // must therefore have a large part of the line's own power as well as of that over the level.
    const auto columns = fit.line(line.track);
    const auto score = fit.score(columns);
    for (std::size_t c = 0; c < columns.size(); ++c) {
        const auto white = fit.filter().apply(columns[c]);
        for (std::size_t i = 0; i < white.size(); ++i) {
            if (innovations[i] != 0.0) innovations[i] -= score.value[c] * white[i];
        }
    }
    const FoundLines left = find_lines(innovations, fit.series().rate_hz);
    const bool same = std::abs(left.scattered_hz - found.scattered_hz) < lines.adjacent_hz;
    return same && left.scattered > found.scattered / lines.left_parts + lines.much_scattered &&
           left.scattered_squares > found.scattered_squares / lines.left_parts;
}

SampleModel with_wandering_line(const SampleFit& fit, const FoundLines& found, const Rows& rows,
                                const effects::Effect* effect, int step) {
    const SampleSeries& series = fit.series();
    double squares = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (!rows[i]) continue;
        squares += fit.innovations()[i] * fit.innovations()[i];
        count += 1.0;
    }
    // Power over the level is chi-squared of two per piece; increments are the angle times 2 sin.
    const double sd = fit.sd(0) * std::sqrt(squares / count);
    const double gain = 2.0 * std::sin(units::pi * found.scattered_hz / series.rate_hz);
    const double rms = sd * std::sqrt(found.scattered / count) / std::max(gain, 1e-6);
    const double duration_s = static_cast<double>(series.size()) * series.interval_s;
    SampleModel model = fit.model();
    model.noise.resonances.push_back({rms, found.scattered_hz, options.samples.screen.known_line_cycles / duration_s});
    model.resonances.push_back({effect, step});
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
            FrequencyTrack track = cosine.track;
            const auto score = fit.score(line_slopes(fit, track, cosine.value, model.columns[k + 1].value));
            // The limit of a step holds a frequency that is not determined to within a cycle over the record.
            step_path(track, Eigen::VectorXd::Map(score.value.data(), static_cast<Eigen::Index>(track.free)),
                      duration_s);
            set_line(model, k, series, track);
        }
        if (!any) break;
        fit = SampleFit(series, std::move(model), rows, SampleFit::Noise::near);
    }
    return fit;
}

}  // namespace ringlock::closure
