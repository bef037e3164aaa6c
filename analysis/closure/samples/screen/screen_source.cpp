#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/screen/parts.hpp"

namespace ringlock::closure {

namespace {

/// The model with each line at that frequency of the source, of all with the same alias, which explains most.
SampleModel with_lines_of_source(const SampleFit& now, SampleModel model) {
    const auto fitted = [&](const SampleModel& m) {
        return SampleFit(now.series(), m, now.rows(), SampleFit::Noise::held).log_likelihood();
    };
    // One line after another, each at every possible frequency.
    const auto choose = [&](double shown_hz, const auto& put) {
        const auto all = of_source(shown_hz, now.series().rate_hz, model.noise.from_hz);
        double most = -std::numeric_limits<double>::infinity();
        SampleModel best;
        for (const Alias& of : all) {
            SampleModel there = model;
            put(there, of);
            const double value = all.size() > 1 ? fitted(there) : 0.0;
            if (value < most) continue;
            most = value;
            best = std::move(there);
        }
        model = std::move(best);
    };
    for (std::size_t k = 0; k + 1 < model.columns.size(); ++k) {
        if (model.columns[k].name != "cosine") continue;
        const FrequencyTrack track = model.columns[k].track;
        choose(track.hz, [&](SampleModel& there, const Alias& of) {
            set_line(there, k, now.series(), track.shown_at(of.hz, of.folded));
        });
    }
    for (std::size_t k = 0; k < model.resonances.size(); ++k) {
        const effects::Effect* effect = model.resonances[k].effect;
        if (effect == nullptr || !is_line(*effect)) continue;
        choose(model.noise.resonances[k].hz,
               [k](SampleModel& there, const Alias& of) { there.noise.resonances[k].hz = of.hz; });
    }
    return model;
}

/// Errors in the start of a fit to a source: interpolated errors of readings look like white rates.
enum class Errors { as_they_are, of_readings };

/// The model with readings of that source.
SampleModel as_of(const SampleFit& now, const SampleSource& source, Errors errors) {
    SampleModel model = now.model();
    model.noise.from_hz = source.from_hz;
    model.noise.from_phase = source.from_phase;
    model.noise.blur_arcsec = 0.2 * now.sd(0);
    model.noise.digits_arcsec = 1e-6 * now.sd(0);
    // Between two readings the errors of both are averaged, to two thirds of the variance of one on average.
    if (errors == Errors::as_they_are) model.noise.angle_arcsec *= std::sqrt(1.5);
    if (errors == Errors::of_readings) {
        // On the line between two readings an increment is a part of their difference.
        double squares = 0.0;
        for (const double x : now.rest()) squares += x * x;
        const double part = std::min(1.0, source.from_hz * now.series().interval_s);
        model.noise.angle_arcsec = std::sqrt(0.5 * squares / static_cast<double>(now.series().size())) / part;
        model.noise.rate_arcsec_rt_s = 0.05 * model.noise.angle_arcsec * std::sqrt(source.from_hz);
    }
    return model;
}

/// The same where straight lines determine the times of the readings exactly.
SampleModel on_straight_lines(const SampleFit& now, const SampleSource& source, Errors errors) {
    SampleModel model = as_of(now, source, errors);
    model.noise.blur_arcsec = 1e-3 * now.sd(0);
    return model;
}

struct Resampled {
    SampleModel model;
    double log_likelihood = 0.0;
};

/// Log-likelihood of a part of the record, with the scale of its noises free.
double log_likelihood_of_shape(const SampleFit& now, const SampleNoise& noise) {
    const SampleSeries& series = now.series();
    const std::size_t part = std::min<std::size_t>(series.size(), 20000);
    const SampleFilter filter(noise, part, series.interval_s);
    const auto e = filter.apply(std::span<const double>(now.rest().data(), part));
    double squares = 0.0;
    double logs = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < part; ++i) {
        if (!now.rows()[i]) continue;
        squares += e[i] * e[i];
        logs += std::log(filter.sd(i));
        count += 1.0;
    }
    return -0.5 * count * std::log(squares / count) - logs;
}

/// The most likely place of the record's start in the source's interval, and the most likely share of errors of
/// readings, which look like a white rate after interpolation.
Resampled best_placed(const SampleFit& now, double from_hz, Errors errors) {
    constexpr int phases = options.samples.screen.phases_of_source;
    Resampled best{{}, -std::numeric_limits<double>::infinity()};
    const auto look_at = [&](SampleModel model) {
        const double value = log_likelihood_of_shape(now, model.noise);
        if (value > best.log_likelihood) best = {std::move(model), value};
    };
    for (int place = 0; place < phases; ++place) {
        look_at(as_of(now, {from_hz, static_cast<double>(place) / phases}, errors));
    }
    if (errors == Errors::of_readings) return best;
    for (int k = 0; k < options.samples.screen.most_error_steps; ++k) {
        const double before = best.log_likelihood;
        SampleModel model = best.model;
        model.noise.angle_arcsec *= options.samples.screen.error_step;
        look_at(std::move(model));
        if (!(best.log_likelihood > before)) break;
    }
    return best;
}

/// Candidates with a source of known rate: nothing is searched, and the rate is held.
void screen_known_source(const SampleFit& now, const KnownSource& source, std::vector<SampleCandidate>& out) {
    auto candidate = candidate_of(OnSamples::transport);
    if (!candidate) return;
    candidate->p_value = source.p_value;
    candidate->parameters = 2;
    candidate->freedom = 2;
    candidate->noise = SampleFit::Noise::free;
    for (SampleModel& model : models_of_source(now, source.from_hz)) {
        model.held_from_hz_sd = source.sd_hz;
        out.push_back(*candidate);
        out.back().model = std::move(model);
    }
}

/// Rate at which a reader latches that is declared to count over whole cycles: that of the dither, as refined by the
/// pattern of the record. No value where no such reader is declared.
std::optional<double> declared_source_hz(const SampleContext& in, double pattern_hz) {
    if (!in.series.whole_cycles || !in.declared.dither_frequency_hz) return std::nullopt;
    const double dither_hz = *in.declared.dither_frequency_hz;
    const double rate_hz = in.series.rate_hz;
    const double shown_hz = std::abs(std::remainder(dither_hz, rate_hz));
    const double off_hz = pattern_hz - shown_hz;
    if (std::abs(off_hz) > options.samples.declared_dither_error * dither_hz) return dither_hz;
    return dither_hz + (std::remainder(dither_hz, rate_hz) > 0.0 ? off_hz : -off_hz);
}

}  // namespace

void screen_source(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    if (now.model().noise.from_hz > 0.0) return;
    if (in.source != nullptr) {
        screen_known_source(now, *in.source, out);
        return;
    }
    const FoundCycle cycle = find_cycle(now.innovations(), in.rows, in.series.rate_hz);
    if (!(cycle.p_value < options.level_of_effects)) return;
    auto candidate = candidate_of(OnSamples::transport);
    if (!candidate) return;
    candidate->p_value = cycle.p_value;
    candidate->look_elsewhere = cycle.look_elsewhere;
    candidate->parameters = 2;
    candidate->freedom = 2;
    candidate->noise = SampleFit::Noise::free;
    const auto offer = [&](SampleModel model) {
        out.push_back(*candidate);
        out.back().model = with_lines_of_source(now, std::move(model));
    };
    if (const auto hz = declared_source_hz(in, cycle.frequency_hz)) {
        if (*hz > options.samples.screen.fastest_source * in.series.rate_hz) return;
        for (SampleModel& model : models_of_source(now, *hz)) {
            out.push_back(*candidate);
            out.back().model = std::move(model);
        }
        return;
    }
    if (const auto source = find_straight_lines(in.series.increment, in.series.rate_hz)) {
        for (const Errors errors : {Errors::as_they_are, Errors::of_readings}) {
            offer(on_straight_lines(now, *source, errors));
        }
        return;
    }
    const SampleScreenOptions& by = options.samples.screen;
    // Rates whose distance from a multiple of the record's rate is that frequency
    const double rate = in.series.rate_hz;
    std::vector<double> rates;
    for (int m = 0; m <= by.most_multiple; ++m) {
        for (const int sign : {-1, 1}) {
            const double from = m * rate + sign * cycle.frequency_hz;
            if (from < by.slowest_source * rate || from > by.fastest_source * rate ||
                std::abs(from - rate) < 1e-9 * rate)
                continue;
            rates.push_back(from);
        }
    }
    std::vector<Resampled> found(rates.size());
    oneapi::tbb::parallel_for(std::size_t{0}, rates.size(),
                              [&](std::size_t k) { found[k] = best_placed(now, rates[k], Errors::as_they_are); });
    // These values are for a part of the record and noises that are not fitted: they may be wrong by tens of nats.
    std::sort(found.begin(), found.end(),
              [](const Resampled& a, const Resampled& b) { return a.log_likelihood > b.log_likelihood; });
    if (!found.empty()) offer(best_placed(now, found.front().model.noise.from_hz, Errors::of_readings).model);
    const double likeliest = found.empty() ? 0.0 : found.front().log_likelihood;
    for (std::size_t k = 0; k < std::min(by.most_sources, found.size()); ++k) {
        if (k < by.fewest_sources || found[k].log_likelihood > likeliest - by.likely_source)
            offer(std::move(found[k].model));
    }
}

SampleModel resampled_from(const SampleFit& now, double from_hz) {
    return best_placed(now, from_hz, Errors::as_they_are).model;
}

std::vector<SampleModel> models_of_source(const SampleFit& now, double from_hz) {
    const SampleSeries& series = now.series();
    const auto lines = find_straight_lines(series.increment, series.rate_hz);
    std::vector<SampleModel> models;
    for (const Errors errors : {Errors::as_they_are, Errors::of_readings}) {
        SampleModel model;
        if (lines && same_source(lines->from_hz, from_hz, series.rate_hz)) {
            model = on_straight_lines(now, *lines, errors);
            move_source(model, series, from_hz - lines->from_hz);
        } else {
            model = best_placed(now, from_hz, errors).model;
        }
        models.push_back(with_lines_of_source(now, std::move(model)));
    }
    return models;
}

SampleModel without_source(const SampleFit& now) {
    SampleModel model = now.model();
    const double rate_hz = now.series().rate_hz;
    for (std::size_t k = 0; k + 1 < model.columns.size(); ++k) {
        if (model.columns[k].name != "cosine") continue;
        const FrequencyTrack track = model.columns[k].track;
        const Alias shown = alias(track.hz, rate_hz);
        set_line(model, k, now.series(), track.shown_at(shown.hz, shown.folded));
    }
    for (SampleNoise::Resonance& resonance : model.noise.resonances) resonance.hz = alias(resonance.hz, rate_hz).hz;
    model.noise.from_hz = model.noise.from_phase = 0.0;
    model.noise.blur_arcsec = model.noise.digits_arcsec = 0.0;
    model.held_from_hz_sd.reset();
    return model;
}

SampleModel resampled_with(const SampleFit& now, const SampleNoise& noise) {
    SampleModel model = now.model();
    model.noise = noise;
    return with_lines_of_source(now, std::move(model));
}

}  // namespace ringlock::closure
