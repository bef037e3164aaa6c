#include "analysis/closure/samples/screen/screen.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/motion.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/fit/steps.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

namespace {

std::shared_ptr<const std::vector<double>> shared(std::vector<double> values) {
    return std::make_shared<const std::vector<double>>(std::move(values));
}

/// The model has columns of the effect.
bool has(const SampleModel& model, const effects::Effect* effect) {
    return std::any_of(model.columns.begin(), model.columns.end(), [&](const auto& c) { return c.effect == effect; });
}

/// The model has columns of effects that show in this way.
bool has(const SampleModel& model, OnSamples as) {
    return std::any_of(model.columns.begin(), model.columns.end(),
                       [&](const auto& c) { return c.effect != nullptr && on_samples(*c.effect) == as; });
}

/// A candidate of the first effect that shows in this way; the others of that kind make the same model. None where the
/// library has no such effect.
std::optional<SampleCandidate> candidate_of(OnSamples as) {
    const Effects all = effects_that_show(as);
    if (all.empty()) return std::nullopt;
    return SampleCandidate{.effect = all.front(), .confounded = {all.begin() + 1, all.end()}};
}

/// Effects that show in this way make the candidate's model as well.
void confound(SampleCandidate& candidate, OnSamples as) {
    for (const effects::Effect* effect : effects_that_show(as)) candidate.confounded.push_back(effect);
}

void screen_rates(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    const std::size_t n = in.series.size();
    const SampleModel& model = now.model();
    // Where the model has left something, slow sums move more than white innovations would let them: by that much less
    // is a slow rate's chi-squared worth.
    double spread = 0.0;
    double sums = 0.0;
    const std::size_t length = std::max<std::size_t>(16, n / 1000);
    for (std::size_t a = 0; a + length <= n; a += length) {
        double sum = 0.0;
        double count = 0.0;
        for (std::size_t i = a; i < a + length; ++i) {
            if (!in.rows[i]) continue;
            sum += now.innovations()[i];
            count += 1.0;
        }
        if (count < 0.5 * static_cast<double>(length)) continue;
        spread += sum * sum / count;
        sums += 1.0;
    }
    const double worth = sums > 20.0 ? std::min(1.0, sums / spread) : 1.0;
    const auto one = [&](SampleColumn column) {
        if (has(model, column.effect)) return;
        const auto score = now.score({now.as_taken(*column.series)});
        if (score.rank == 0) return;
        SampleCandidate c{.effect = column.effect, .model = model, .p_value = chi2_tail(worth * score.chi2, 1)};
        column.step = in.step;
        c.model.columns.push_back(std::move(column));
        out.push_back(std::move(c));
    };
    for (SampleColumn& column : rate_columns(in.series)) one(std::move(column));
    auto candidate = candidate_of(OnSamples::step);
    if (!candidate || has(model, OnSamples::step)) return;
    // Steps: everywhere, coarsely, then about the best.
    std::vector<double> roots;
    double best = 0.0;
    std::size_t at = 0;
    const double root_of_worth = std::sqrt(worth);
    constexpr std::size_t places = places_of_a_step;
    for (std::size_t k = 1; k < places; ++k) {
        const double root = root_of_worth * root_of_step(now, n * k / places);
        roots.push_back(root);
        if (std::abs(root) > best) {
            best = std::abs(root);
            at = n * k / places;
        }
    }
    double as_good = 0.0;
    for (const double root : roots) as_good += std::exp(0.5 * (root * root - best * best));
    SampleCandidate& c = *candidate;
    c.model = model;
    c.p_value = davies_bound(best * best, roots);
    c.places = static_cast<double>(places) / as_good;
    at = refine_place(now, at, n / places / 2);
    best = root_of_worth * std::abs(root_of_step(now, at));
    c.searched = places_of_step(best * best, 0.5 / static_cast<double>(places));
    // One that is forgotten within less than there is between these places shows at its own only.
    const auto jump = jump_beside_random(now);
    if (jump && jump->length < n / places) {
        const std::size_t place = refine_place(now, jump->row, jump->length);
        const double root = root_of_worth * std::abs(root_of_step(now, place));
        if (root > best) {
            at = place;
            c.searched = jump->places;
            c.places = jump->places;
            c.p_value = of_several(chi2_tail(root * root, 1), jump->places);
        }
    }
    if (c.p_value > 0.01) return;
    c.model.columns.push_back(step_column(*c.effect, in.series, at));
    c.model.columns.back().step = in.step;
    out.push_back(std::move(c));
}

void screen_noises(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    const auto one = [&](OnSamples as, SampleModel model) {
        auto candidate = candidate_of(as);
        if (!candidate) return;
        const SampleFit fit(in.series, std::move(model), in.rows, SampleFit::Noise::near);
        const double chi2 = std::max(0.0, 2.0 * fit.gain_over(now));
        candidate->model = fit.model();
        // A variance cannot be negative: half of the time there is no gain at all (Chernoff 1954).
        candidate->p_value = 0.5 * chi2_tail(chi2, 1);
        out.push_back(*std::move(candidate));
    };
    const double duration_s = static_cast<double>(in.series.size()) * in.series.interval_s;
    const double known =
        now.model().noise.rate_arcsec_rt_s / std::sqrt(duration_s) + now.model().noise.angle_arcsec / duration_s;
    // Only where sums over long stretches move more than the white noises let them.
    {
        std::vector<std::vector<double>> slow;
        for (int k = 1; k <= 12; ++k) {
            std::vector<double> rate(in.series.size());
            for (std::size_t i = 0; i < rate.size(); ++i) {
                rate[i] = std::cos(units::pi * k * (static_cast<double>(i) + 0.5) / static_cast<double>(rate.size()));
            }
            slow.push_back(std::move(rate));
        }
        const auto score = now.score(slow);
        if (chi2_tail(score.chi2, score.rank) > 0.05) return;
    }
    if (!now.model().walk) {
        SampleModel model = now.model();
        model.walk = true;
        model.noise.walk_arcsec2_s3 = 10.0 * known * known / duration_s;
        one(OnSamples::walk, std::move(model));
    }
    if (!now.model().flicker) {
        SampleModel model = now.model();
        model.flicker = true;
        model.flicker_deg_h = 3.0 * known;
        model.noise.terms = flicker_terms(model.flicker_deg_h, 4.0 * in.series.interval_s, duration_s);
        one(OnSamples::flicker, std::move(model));
    }
}

/// Lines have the level of two effects. Lines that keep their frequency have that of a line in the input rate. That of
/// a line in the output goes to lines that drift; where a dither is declared, nearly all of it goes to lines near its
/// frequency and its harmonics, one half to lines that keep their frequency and one to those that drift: a declaration
/// makes these likely.
struct LineShares {
    double drifting = 1.0;
    double declared = 0.0;
};
constexpr LineShares nothing_declared{1.0, 0.0};
constexpr LineShares dither_declared{0.1, 0.45};
constexpr int most_harmonics = 3;
/// Of the declared: most is left of the dither itself.
constexpr std::array<double, most_harmonics> of_harmonic{0.7, 0.15, 0.15};

/// A line of the share of a level.
struct OfferedLine {
    FoundLine found;
    bool drifts = false;
    bool declared = false;
};

void take_share(FoundLine& line, double share) {
    line.searched /= share;
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

/// The likeliest line near the declared dither or a harmonic, by its own frequency range and drifts of a physical size.
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
    candidate->searched = lines.tracked.searched;
    candidate->parameters = 3;
    candidate->freedom = 3;
    candidate->hz = lines.scattered_hz;
    candidate->wanders = true;
    candidate->model = with_wandering_line(now, lines, in.rows, candidate->effect, in.step);
    return candidate;
}

/// Whether it would be a rate that changes, were it everywhere as slow as where it is slowest.
bool is_slow(const LineCourse& course, double duration_s) {
    constexpr int places = 64;
    for (int i = 0; i <= places; ++i) {
        const double since_middle_s = duration_s * (static_cast<double>(i) / places - 0.5);
        if (course.frequency_hz(since_middle_s) * duration_s < fewest_cycles) return true;
    }
    return false;
}

/// A line on a curve, where power is scattered that none which drifts evenly has.
std::optional<SampleCandidate> bent_line(const SampleFit& now, const SampleContext& in, const FoundLines& lines,
                                         const std::vector<double>& e) {
    auto candidate = candidate_of(OnSamples::angle_line);
    if (!candidate) return std::nullopt;
    const FoundCourse found = follow_bends(e, in.series.rate_hz, lines);
    if (found.course.free < 3) return std::nullopt;
    const SampleLine line = refine_line(now, found.course);
    if (is_slow(line.course, static_cast<double>(in.series.size()) * in.series.interval_s)) return std::nullopt;
    if (scatters(now, e, lines, line)) return std::nullopt;
    const double searched = places_of_bends(line.chi2, 0.5 * static_cast<double>(e.size()), found.course.free);
    candidate->model = now.model();
    candidate->p_value = of_several(chi2_tail(line.chi2, 2), searched);
    candidate->searched = searched;
    candidate->parameters = 2;
    candidate->freedom = 2;
    candidate->hz = lines.scattered_hz;
    add_line(candidate->model, in.series, line.course, *candidate->effect, in.step);
    return candidate;
}

void screen_line(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    constexpr double worth_looking = 0.01;
    // The level of the spectrum about a line is itself a random number, and of a resampled record a part of a line is
    // in its images: what the regression says is closer.
    constexpr double worth_mending = 0.2;
    // Above that a base hardly moves.
    constexpr double fast_hz = 30.0;
    std::vector<double> e = now.innovations();
    for (std::size_t i = 0; i < e.size(); ++i) {
        if (!in.rows[i]) e[i] = 0.0;
    }
    const double duration_s = static_cast<double>(in.series.size()) * in.series.interval_s;
    // What is left beside a line that is in the model is that line, not being what the model says.
    const double width_hz = 64.0 / duration_s;
    const FoundLines lines = find_lines(e, in.series.rate_hz, in.lines_hz, width_hz);
    const FoundLine likeliest = lines.likeliest();
    const auto refined = [&](const FoundLine& line, bool drifts) {
        return refine_line(now, drifts ? LineCourse::even(line.frequency_hz, line.drift_hz_per_s)
                                       : LineCourse::still(line.frequency_hz));
    };
    bool scattered = false;
    if (likeliest.p_value < worth_looking) {
        const SampleLine still = refined(likeliest, false);
        const SampleLine drifting = refined(likeliest, true);
        // Slow ones are what a base does as well.
        const bool declared = near_declared(now, in, lines.scattered_hz);
        const auto offer = [&](std::optional<SampleCandidate> candidate) {
            if (!candidate) return;
            candidate->nameless = !declared && lines.scattered_hz <= fast_hz;
            if (!declared) confound(*candidate, OnSamples::rate_line);
            out.push_back(*std::move(candidate));
        };
        if (lines.scattered > drifting.chi2 + much_scattered) offer(bent_line(now, in, lines, e));
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
        if (!(line.found.p_value < worth_mending)) continue;
        if (scattered && std::abs(line.found.frequency_hz - lines.scattered_hz) < beside_hz) continue;
        const SampleLine mended = refined(line.found, line.drifts);
        // What hardly drifts is told as well without.
        if (line.drifts && !(std::abs(mended.course.drifts[0]) * duration_s * duration_s > 1.0)) continue;
        const bool fast = mended.course.hz > fast_hz;
        const bool dither = line.declared || line.drifts;
        const OnSamples as = dither || fast ? OnSamples::angle_line : OnSamples::rate_line;
        auto candidate = candidate_of(as);
        if (!candidate) continue;
        candidate->model = now.model();
        candidate->p_value = of_several(chi2_tail(mended.chi2, 2), line.found.searched);
        candidate->searched = line.found.searched;
        candidate->parameters = 2;
        candidate->freedom = 2;
        candidate->hz = line.found.frequency_hz;
        if (!dither) confound(*candidate, fast ? OnSamples::rate_line : OnSamples::angle_line);
        add_line(candidate->model, in.series, mended.course, *candidate->effect, in.step);
        out.push_back(*std::move(candidate));
    }
}

/// The lines that the model has, at those frequencies of a source that explain most of the record.
SampleModel with_lines_of_source(const SampleFit& now, SampleModel model) {
    const auto fitted = [&](const SampleModel& m) {
        return SampleFit(now.series(), m, now.rows(), SampleFit::Noise::held).log_likelihood();
    };
    // One line after another, each tried wherever it may be.
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
        const LineCourse course = model.columns[k].course;
        choose(course.hz, [&](SampleModel& there, const Alias& of) {
            set_line(there, k, now.series(), course.shown_at(of.hz, of.folded));
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

/// What is interpolated looks as if it were rates.
enum class Errors { as_they_are, of_readings };

/// The model as of readings of that source.
SampleModel as_of(const SampleFit& now, const SampleSource& source, Errors errors) {
    SampleModel model = now.model();
    model.noise.from_hz = source.from_hz;
    model.noise.from_phase = source.from_phase;
    model.noise.blur_arcsec = 0.2 * now.sd(0);
    model.noise.digits_arcsec = 1e-6 * now.sd(0);
    // Between two readings the errors of both average out, to two thirds of the variance of one in the mean.
    if (errors == Errors::as_they_are) model.noise.angle_arcsec *= std::sqrt(1.5);
    if (errors == Errors::of_readings) {
        // On the line between two readings an increment is a part of what they differ by.
        double squares = 0.0;
        for (const double x : now.rest()) squares += x * x;
        const double part = std::min(1.0, source.from_hz * now.series().interval_s);
        model.noise.angle_arcsec = std::sqrt(0.5 * squares / static_cast<double>(now.series().size())) / part;
        model.noise.rate_arcsec_rt_s = 0.05 * model.noise.angle_arcsec * std::sqrt(source.from_hz);
    }
    return model;
}

struct Resampled {
    SampleModel model;
    double log_likelihood = 0.0;
};

/// Of a part of the record, the scale of its noises left free.
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

/// From where in the source's interval the likelihood likes best, and with what share of errors of readings: what is
/// interpolated has less of them, and looks like a rate in their place.
Resampled best_placed(const SampleFit& now, double from_hz, Errors errors) {
    constexpr int places = 8;
    Resampled best{{}, -std::numeric_limits<double>::infinity()};
    const auto look_at = [&](SampleModel model) {
        const double value = log_likelihood_of_shape(now, model.noise);
        if (value > best.log_likelihood) best = {std::move(model), value};
    };
    for (int place = 0; place < places; ++place) {
        look_at(as_of(now, {from_hz, static_cast<double>(place) / places}, errors));
    }
    if (errors == Errors::of_readings) return best;
    constexpr double factor = 1.5;
    constexpr int most = 10;  // a record's own errors may hardly show beside its rates
    for (int k = 0; k < most; ++k) {
        const double before = best.log_likelihood;
        SampleModel model = best.model;
        model.noise.angle_arcsec *= factor;
        look_at(std::move(model));
        if (!(best.log_likelihood > before)) break;
    }
    return best;
}

void screen_resampling(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    if (now.model().noise.from_hz > 0.0) return;
    const FoundCycle cycle = find_cycle(now.innovations(), in.rows, in.series.rate_hz);
    if (!(cycle.p_value < options.level_of_effects)) return;
    auto candidate = candidate_of(OnSamples::transport);
    if (!candidate) return;
    candidate->p_value = cycle.p_value;
    candidate->searched = cycle.searched;
    candidate->parameters = 2;
    candidate->freedom = 2;
    candidate->noise = SampleFit::Noise::free;
    const auto offer = [&](SampleModel model) {
        out.push_back(*candidate);
        out.back().model = with_lines_of_source(now, std::move(model));
    };
    if (const auto source = find_straight_lines(in.series.increment, in.series.rate_hz)) {
        for (const Errors errors : {Errors::as_they_are, Errors::of_readings}) {
            SampleModel model = as_of(now, *source, errors);
            // Where the readings lie is known exactly.
            model.noise.blur_arcsec = 1e-3 * now.sd(0);
            offer(std::move(model));
        }
        return;
    }
    // Rates whose distance from a multiple of the record's is that frequency
    const double rate = in.series.rate_hz;
    std::vector<double> rates;
    for (int m = 0; m <= 4; ++m) {
        for (const int sign : {-1, 1}) {
            const double from = m * rate + sign * cycle.frequency_hz;
            if (from < 0.3 * rate || from > 4.5 * rate || std::abs(from - rate) < 1e-9 * rate) continue;
            rates.push_back(from);
        }
    }
    std::vector<Resampled> found(rates.size());
    oneapi::tbb::parallel_for(std::size_t{0}, rates.size(),
                              [&](std::size_t k) { found[k] = best_placed(now, rates[k], Errors::as_they_are); });
    // That was on a part of the record, with noises that are not fitted: it may be wrong by tens of nats.
    std::sort(found.begin(), found.end(),
              [](const Resampled& a, const Resampled& b) { return a.log_likelihood > b.log_likelihood; });
    constexpr std::size_t least = 3;
    constexpr std::size_t most = 7;
    constexpr double as_likely = 40.0;
    if (!found.empty()) offer(best_placed(now, found.front().model.noise.from_hz, Errors::of_readings).model);
    const double likeliest = found.empty() ? 0.0 : found.front().log_likelihood;
    for (std::size_t k = 0; k < std::min(most, found.size()); ++k) {
        if (k < least || found[k].log_likelihood > likeliest - as_likely) offer(std::move(found[k].model));
    }
}

/// A motion that is the witness's and turned by a quarter of a cycle, slow drifts left out: two numbers tell of weak
/// motion what a response of many lags cannot.
std::optional<SampleCandidate> weak_motion(const SampleFit& now, const SampleContext& in) {
    double best = 0.0;
    std::size_t at = 0;
    int rank = 0;
    for (std::size_t w = 0; w < in.series.witnesses.size(); ++w) {
        auto columns = motion_columns(in.series.witnesses[w].second);
        for (auto& column : columns) column = now.as_taken(column);
        const auto score = now.score(columns);
        if (score.chi2 <= best) continue;
        best = score.chi2;
        rank = score.rank;
        at = w;
    }
    const auto count = static_cast<double>(in.series.witnesses.size());
    const double p = rank > 0 ? of_several(chi2_tail(best, rank), 2.0 * count) : 1.0;
    if (!(p < options.level_of_effects)) return std::nullopt;
    auto candidate = candidate_of(OnSamples::motion);
    if (!candidate) return std::nullopt;
    candidate->model = now.model();
    candidate->p_value = p;
    candidate->searched = 2.0 * count;
    candidate->parameters = rank;
    candidate->freedom = rank;
    candidate->witness = at;
    add_motion(candidate->model, in.series, *candidate->effect, at, in.step);
    return candidate;
}

void screen_witnesses(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    if (in.series.witnesses.empty() || !now.model().motion.empty() || has(now.model(), OnSamples::motion)) return;
    const auto weak = weak_motion(now, in);
    FoundWitness witness = find_witness(now.innovations(), in.rows, in.series);
    // A motion of few frequencies shows by two numbers first, however strong it is.
    if (weak && !(witness.p_value < weak->p_value)) {
        witness.p_value = weak->p_value;
        witness.index = weak->witness;
    }
    if (weak) out.push_back(*weak);
    if (!(witness.p_value < options.level_of_effects)) return;
    auto candidate = candidate_of(OnSamples::motion);
    if (!candidate) return;
    candidate->model = moved_as(now, *candidate->effect, witness.index, in.step);
    candidate->p_value = witness.p_value;
    candidate->searched = static_cast<double>(in.series.witnesses.size());
    candidate->parameters = 2 * witness.lags + 1;
    candidate->freedom = 2 * witness.lags + 1;
    candidate->strong = true;
    candidate->witness = witness.index;
    out.push_back(*std::move(candidate));
}

}  // namespace

SampleModel resampled_from(const SampleFit& now, double from_hz) {
    return best_placed(now, from_hz, Errors::as_they_are).model;
}

std::vector<SampleColumn> rate_columns(const SampleSeries& series, std::span<const effects::Effect* const> library) {
    const bool warms = !series.temperature_change_k.empty();
    const bool turns = !series.input_rate_deg_h.empty();
    const std::size_t last = series.size() - 1;
    // What the record was exposed to in that row. Temperatures and input rates are those of the middle of the interval,
    // and go on from there as steeply as from the row before to the row behind.
    const auto exposure = [&](std::size_t row) {
        effects::Interval at{.start_s = static_cast<double>(row) * series.interval_s, .duration_s = series.interval_s};
        const auto ends = [&](const std::vector<double>& values, double(&both)[2]) {
            const std::size_t before = row == 0 ? 0 : row - 1;
            const std::size_t behind = std::min(row + 1, last);
            const double half = 0.5 * (values[behind] - values[before]) / static_cast<double>(behind - before);
            both[0] = values[row] - half;
            both[1] = values[row] + half;
        };
        if (warms) ends(series.temperature_change_k, at.temperature_change_k);
        if (turns) ends(series.input_rate_deg_h, at.input_rate_deg_h);
        return at;
    };
    std::vector<SampleColumn> columns;
    for (const effects::Effect* effect : effects_that_show(OnSamples::rate, library)) {
        const auto angle = unit_angle(*effect);
        std::vector<double> values(series.size());
        for (std::size_t i = 0; i < values.size(); ++i) values[i] = angle(exposure(i));
        // A rate that does not change is part of the mean rate.
        const auto [low, high] = std::minmax_element(values.begin(), values.end());
        if (!(*high > *low)) continue;
        columns.push_back({.effect = effect,
                           .name = std::string(parameter_of(*effect, effects::Role::size).name),
                           .series = shared(std::move(values))});
    }
    return columns;
}

void add_line(SampleModel& model, const SampleSeries& series, const LineCourse& course, const effects::Effect& effect,
              int step) {
    for (const char* name : {"cosine", "sine"}) {
        model.columns.push_back({.effect = &effect, .name = name});
        model.columns.back().step = step;
    }
    set_line(model, model.columns.size() - 2, series, course);
}

std::vector<SampleCandidate> screen_samples(const SampleFit& now, const SampleContext& in) {
    std::vector<SampleCandidate> out;
    screen_rates(now, in, out);
    screen_noises(now, in, out);
    if (in.slow) return out;
    screen_line(now, in, out);
    screen_witnesses(now, in, out);
    screen_resampling(now, in, out);
    return out;
}

}  // namespace ringlock::closure
