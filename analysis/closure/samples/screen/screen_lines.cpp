#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/model/source.hpp"
#include "analysis/closure/samples/screen/parts.hpp"
#include "analysis/closure/stats/p_values.hpp"

namespace ringlock::closure {

namespace {

/// Lines have the level of two effects. Lines of constant frequency have that of a line in the input rate. The level of
/// a line in the output angle belongs to lines that drift. Where a dither is declared, nearly all of it belongs to
/// lines near its frequency and its harmonics, one half to lines of constant frequency and one half to those that
/// drift, since a declaration makes these likely.
struct LineShares {
    double drifting = 1.0;
    double declared = 0.0;
};
constexpr LineShares nothing_declared{1.0, 0.0};
constexpr LineShares dither_declared{options.samples.screen.drifting_share_if_declared,
                                     options.samples.screen.declared_share};
constexpr auto of_harmonic = options.samples.screen.harmonic_shares;
constexpr int most_harmonics = static_cast<int>(of_harmonic.size());

/// A line with its share of the level.
struct OfferedLine {
    FoundLine found;
    bool drifts = false;
    bool declared = false;
};

void take_share(FoundLine& line, double share) {
    line.look_elsewhere /= share;
    line.p_value = std::min(1.0, line.p_value / share);
}

bool near_declared(const SampleFit& now, const SampleContext& in, double hz) {
    if (!in.declared.dither_frequency_hz) return false;
    for (int h = 1; h <= most_harmonics; ++h) {
        const double of_dither = h * *in.declared.dither_frequency_hz;
        const double shown = alias(of_dither, in.series.rate_hz, now.model().noise.from_hz).hz;
        if (std::abs(hz - shown) < options.samples.declared_dither_error * of_dither) return true;
    }
    return false;
}

/// The most likely line near the declared dither or a harmonic, within its own range of frequencies and of physical
/// drifts.
std::vector<OfferedLine> declared_lines(const SampleFit& now, const SampleContext& in, const std::vector<double>& e,
                                        double width_hz) {
    OfferedLine still{{}, false, true};
    OfferedLine drifting{{}, true, true};
    for (int h = 1; h <= most_harmonics; ++h) {
        const double of_dither = h * *in.declared.dither_frequency_hz;
        const double shown = alias(of_dither, in.series.rate_hz, now.model().noise.from_hz).hz;
        NarrowLines lines = find_lines_in(
            e, in.series.rate_hz,
            {shown, options.samples.declared_dither_error * of_dither, options.samples.dither_drift_per_s * of_dither},
            in.lines_hz, width_hz);
        const double share = dither_declared.declared * of_harmonic[static_cast<std::size_t>(h - 1)];
        take_share(lines.still, share);
        take_share(lines.drifting, share);
        if (lines.still.p_value < still.found.p_value) still.found = lines.still;
        if (lines.drifting.p_value < drifting.found.p_value) drifting.found = lines.drifting;
    }
    return {still, drifting};
}

std::optional<SampleCandidate> wandering_line(const SampleFit& now, const SampleContext& in, const FoundLines& lines,
                                              double p_value) {
    auto candidate = candidate_of(OnSamples::angle_line);
    if (!candidate) return std::nullopt;
    candidate->p_value = p_value;
    candidate->look_elsewhere = lines.tracked.look_elsewhere;
    candidate->parameters = 3;
    candidate->freedom = 3;
    candidate->hz = lines.scattered_hz;
    candidate->wanders = true;
    candidate->model = with_wandering_line(now, lines, in.rows, candidate->effect, in.step);
    return candidate;
}

/// Whether the lowest frequency of the line is too low to distinguish it from a slow rate.
bool is_slow(const FrequencyTrack& track, double duration_s) {
    constexpr int positions = 64;
    for (int i = 0; i <= positions; ++i) {
        const double since_middle_s = duration_s * (static_cast<double>(i) / positions - 0.5);
        if (track.frequency_hz(since_middle_s) * duration_s < options.samples.lines.fewest_cycles) return true;
    }
    return false;
}

/// A line on a curved frequency track, where no line of even drift contains all of the scattered power.
std::optional<SampleCandidate> bent_line(const SampleFit& now, const SampleContext& in, const FoundLines& lines,
                                         const std::vector<double>& e) {
    auto candidate = candidate_of(OnSamples::angle_line);
    if (!candidate) return std::nullopt;
    const FoundTrack found = follow_bends(e, in.series.rate_hz, lines);
    if (found.track.free < 3) return std::nullopt;
    const SampleLine line = refine_line(now, found.track);
    if (is_slow(line.track, static_cast<double>(in.series.size()) * in.series.interval_s)) return std::nullopt;
    if (scatters(now, e, lines, line)) return std::nullopt;
    const double look_elsewhere =
        look_elsewhere_of_track(line.chi2, 0.5 * static_cast<double>(e.size()), found.track.free);
    candidate->model = now.model();
    candidate->p_value = of_several(chi2_tail(line.chi2, 2), look_elsewhere);
    candidate->look_elsewhere = look_elsewhere;
    candidate->parameters = 2;
    candidate->freedom = 2;
    candidate->hz = lines.scattered_hz;
    add_line(candidate->model, in.series, line.track, *candidate->effect, in.step);
    return candidate;
}

/// Width about a line of the model in which no other line is searched: the residual there belongs to that line, which
/// may differ from its model. Where the dither was left in the samples, its harmonics may be aliased next to each
/// other.
double width_of_known_hz(const SampleContext& in) {
    const double duration_s = static_cast<double>(in.series.size()) * in.series.interval_s;
    double width_hz = options.samples.screen.known_line_cycles / duration_s;
    if (!in.series.dither_left || !in.declared.dither_frequency_hz) return width_hz;
    const int harmonics = options.samples.reader.harmonics;
    for (int k = 1; k <= harmonics; ++k) {
        for (int other = k + 1; other <= harmonics; ++other) {
            const double apart_hz = std::abs(alias(k * *in.declared.dither_frequency_hz, in.series.rate_hz).hz -
                                             alias(other * *in.declared.dither_frequency_hz, in.series.rate_hz).hz);
            if (apart_hz > options.samples.screen.resolved_cycles / duration_s) {
                width_hz = std::min(width_hz, 0.5 * apart_hz);
            }
        }
    }
    return width_hz;
}

}  // namespace

void screen_lines(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    const SampleScreenOptions& by = options.samples.screen;
    std::vector<double> e = now.innovations();
    for (std::size_t i = 0; i < e.size(); ++i) {
        if (!in.rows[i]) e[i] = 0.0;
    }
    const double duration_s = static_cast<double>(in.series.size()) * in.series.interval_s;
    const double width_hz = width_of_known_hz(in);
    const FoundLines lines = find_lines(e, in.series.rate_hz, in.lines_hz, width_hz);
    const FoundLine likeliest = lines.likeliest();
    const auto refined = [&](const FoundLine& line, bool drifts) {
        return refine_line(now, drifts ? FrequencyTrack::even(line.frequency_hz, line.drift_hz_per_s)
                                       : FrequencyTrack::still(line.frequency_hz));
    };
    bool scattered = false;
    if (likeliest.p_value < by.line_p) {
        const SampleLine still = refined(likeliest, false);
        const SampleLine drifting = refined(likeliest, true);
        const bool declared = near_declared(now, in, lines.scattered_hz);
        const auto offer = [&](std::optional<SampleCandidate> candidate) {
            if (!candidate) return;
            candidate->placeholder = !declared && lines.scattered_hz <= by.fast_hz;
            if (!declared) confound(*candidate, OnSamples::rate_line);
            out.push_back(*std::move(candidate));
        };
        if (lines.scattered > drifting.chi2 + options.samples.lines.much_scattered) offer(bent_line(now, in, lines, e));
        if (scatters(now, e, lines, drifting.chi2 > still.chi2 ? drifting : still)) {
            offer(wandering_line(now, in, lines, likeliest.p_value));
            scattered = true;
        }
    }
    const LineShares shares = in.declared.dither_frequency_hz ? dither_declared : nothing_declared;
    std::vector<OfferedLine> offered{{lines.still}};
    for (FoundLine line : {lines.slow, lines.tracked}) {
        take_share(line, 0.5 * shares.drifting);
        offered.push_back({line, true});
    }
    std::erase_if(offered, [&](const OfferedLine& line) { return near_declared(now, in, line.found.frequency_hz); });
    if (in.declared.dither_frequency_hz) {
        for (OfferedLine& line : declared_lines(now, in, e, width_hz)) offered.push_back(std::move(line));
    }
    for (const OfferedLine& line : offered) {
        if (!(line.found.p_value < by.refined_line_p)) continue;
        if (scattered && std::abs(line.found.frequency_hz - lines.scattered_hz) < options.samples.lines.adjacent_hz)
            continue;
        const SampleLine mended = refined(line.found, line.drifts);
        // A line that hardly drifts is described as well without the drift.
        if (line.drifts && !(std::abs(mended.track.drifts[0]) * duration_s * duration_s > by.least_drift_cycles))
            continue;
        const bool fast = mended.track.hz > by.fast_hz;
        const bool dither = line.declared || line.drifts;
        const OnSamples as = dither || fast ? OnSamples::angle_line : OnSamples::rate_line;
        auto candidate = candidate_of(as);
        if (!candidate) continue;
        candidate->model = now.model();
        candidate->p_value = of_several(chi2_tail(mended.chi2, 2), line.found.look_elsewhere);
        candidate->look_elsewhere = line.found.look_elsewhere;
        candidate->parameters = 2;
        candidate->freedom = 2;
        candidate->hz = line.found.frequency_hz;
        if (!dither) confound(*candidate, fast ? OnSamples::rate_line : OnSamples::angle_line);
        add_line(candidate->model, in.series, mended.track, *candidate->effect, in.step);
        out.push_back(*std::move(candidate));
    }
}

void add_line(SampleModel& model, const SampleSeries& series, const FrequencyTrack& track,
              const effects::Effect& effect, int step) {
    for (const char* name : {"cosine", "sine"}) {
        model.columns.push_back({.effect = &effect, .name = name});
        model.columns.back().step = step;
    }
    set_line(model, model.columns.size() - 2, series, track);
}

}  // namespace ringlock::closure
