#include "analysis/closure/samples/screen/screen.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/motion.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/fit/steps.hpp"
#include "analysis/closure/samples/screen/parts.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

namespace {

std::shared_ptr<const std::vector<double>> shared(std::vector<double> values) {
    return std::make_shared<const std::vector<double>>(std::move(values));
}

/// Whether the model has columns of the effect.
bool has(const SampleModel& model, const effects::Effect* effect) {
    return std::any_of(model.columns.begin(), model.columns.end(), [&](const auto& c) { return c.effect == effect; });
}

/// Whether the model has columns of effects that act in this way.
bool has(const SampleModel& model, OnSamples as) {
    return std::any_of(model.columns.begin(), model.columns.end(),
                       [&](const auto& c) { return c.effect != nullptr && on_samples(*c.effect) == as; });
}

void screen_rates(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out) {
    const SampleScreenOptions& by = options.samples.screen;
    const std::size_t n = in.series.size();
    const SampleModel& model = now.model();
    // Where the residual has structure, slow sums have a larger variance than those of white innovations. The
    // chi-squared of a slow rate is divided by that ratio.
    double spread = 0.0;
    double sums = 0.0;
    const std::size_t length = std::max(by.slow_rows, n / by.slow_parts);
    for (std::size_t a = 0; a + length <= n; a += length) {
        double sum = 0.0;
        double count = 0.0;
        for (std::size_t i = a; i < a + length; ++i) {
            if (!in.rows[i]) continue;
            sum += now.innovations()[i];
            count += 1.0;
        }
        if (count < by.slow_share * static_cast<double>(length)) continue;
        spread += sum * sum / count;
        sums += 1.0;
    }
    const double worth = sums > by.slow_sums ? std::min(1.0, sums / spread) : 1.0;
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
    // Steps: at all places of a coarse grid, then about the best one.
    std::vector<double> roots;
    double best = 0.0;
    std::size_t at = 0;
    const double root_of_worth = std::sqrt(worth);
    const std::size_t positions = options.samples.fit.positions_of_step;
    for (std::size_t k = 1; k < positions; ++k) {
        const double root = root_of_worth * root_of_step(now, n * k / positions);
        roots.push_back(root);
        if (std::abs(root) > best) {
            best = std::abs(root);
            at = n * k / positions;
        }
    }
    double as_good = 0.0;
    for (const double root : roots) as_good += std::exp(0.5 * (root * root - best * best));
    SampleCandidate& c = *candidate;
    c.model = model;
    c.p_value = davies_bound(best * best, roots);
    c.positions = static_cast<double>(positions) / as_good;
    at = refine_place(now, at, n / positions / 2);
    best = root_of_worth * std::abs(root_of_step(now, at));
    c.look_elsewhere = look_elsewhere_of_step(best * best, 0.5 / static_cast<double>(positions));
    // With a random rate, a step that decays within less than the distance of these places is visible near its time
    // only.
    const auto jump = jump_with_random_rate(now);
    if (jump && jump->length < n / positions) {
        const std::size_t place = refine_place(now, jump->row, jump->length);
        const double root = root_of_worth * std::abs(root_of_step(now, place));
        if (root > best) {
            at = place;
            c.look_elsewhere = jump->positions;
            c.positions = jump->positions;
            c.p_value = of_several(chi2_tail(root * root, 1), jump->positions);
        }
    }
    if (c.p_value > by.step_p) return;
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
        // A variance cannot be negative: the gain is zero with probability one half (Chernoff 1954).
        candidate->p_value = 0.5 * chi2_tail(chi2, 1);
        out.push_back(*std::move(candidate));
    };
    const double duration_s = static_cast<double>(in.series.size()) * in.series.interval_s;
    const double known =
        now.model().noise.rate_arcsec_rt_s / std::sqrt(duration_s) + now.model().noise.angle_arcsec / duration_s;
    // Only where sums over long stretches vary more than white noises make them vary.
    {
        std::vector<std::vector<double>> slow;
        for (int k = 1; k <= options.samples.screen.slow_cosines; ++k) {
            std::vector<double> rate(in.series.size());
            for (std::size_t i = 0; i < rate.size(); ++i) {
                rate[i] = std::cos(units::pi * k * (static_cast<double>(i) + 0.5) / static_cast<double>(rate.size()));
            }
            slow.push_back(std::move(rate));
        }
        const auto moves = [&](const std::vector<std::vector<double>>& cosines) {
            const auto score = now.score(cosines);
            return chi2_tail(score.chi2, score.rank) <= options.samples.screen.random_rate_p;
        };
        // A short record shows one slow change of a random walk at most, the first cosine.
        const bool is_short = duration_s < options.samples.contest.trend_determined_s;
        if (!moves(slow) && !(is_short && moves({slow.front()}))) return;
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

/// A motion in proportion to a witness, and a quarter of a cycle later, without slow drifts: these two numbers show a
/// weak motion better than a response of many lags.
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
    candidate->look_elsewhere = 2.0 * count;
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
    // A motion of few frequencies is shown by two numbers first, even if it is strong.
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
    candidate->look_elsewhere = static_cast<double>(in.series.witnesses.size());
    candidate->parameters = 2 * witness.lags + 1;
    candidate->freedom = 2 * witness.lags + 1;
    candidate->strong = true;
    candidate->witness = witness.index;
    out.push_back(*std::move(candidate));
}

}  // namespace

std::optional<SampleCandidate> candidate_of(OnSamples as) {
    const Effects all = effects_that_show(as);
    if (all.empty()) return std::nullopt;
    return SampleCandidate{.effect = all.front(), .confounded = {all.begin() + 1, all.end()}};
}

void confound(SampleCandidate& candidate, OnSamples as) {
    for (const effects::Effect* effect : effects_that_show(as)) candidate.confounded.push_back(effect);
}

std::vector<SampleColumn> rate_columns(const SampleSeries& series, std::span<const effects::Effect* const> library) {
    const bool warms = !series.temperature_change_k.empty();
    const bool turns = !series.input_rate_deg_h.empty();
    const std::size_t last = series.size() - 1;
    // Exposure of the record in that row. Temperatures and input rates are those of the middle of the interval. Over
    // the interval, temperatures change by the slope of the series, input rates by the slope from the row before to the
    // row after.
    const auto exposure = [&](std::size_t row) {
        effects::Interval at{.start_s = static_cast<double>(row) * series.interval_s, .duration_s = series.interval_s};
        const auto ends = [](double middle, double half, double(&both)[2]) {
            both[0] = middle - half;
            both[1] = middle + half;
        };
        if (warms) {
            const double half_k = 0.5 * series.interval_s * series.temperature_slope_k_per_s[row];
            ends(series.temperature_change_k[row], half_k, at.temperature_change_k);
        }
        if (turns) {
            const auto& rates = series.input_rate_deg_h;
            const std::size_t before = row == 0 ? 0 : row - 1;
            const std::size_t behind = std::min(row + 1, last);
            const double half = 0.5 * (rates[behind] - rates[before]) / static_cast<double>(behind - before);
            ends(rates[row], half, at.input_rate_deg_h);
        }
        return at;
    };
    std::vector<SampleColumn> columns;
    for (const effects::Effect* effect : effects_that_show(OnSamples::rate, library)) {
        const auto angle = unit_angle(*effect);
        std::vector<double> values(series.size());
        for (std::size_t i = 0; i < values.size(); ++i) values[i] = angle(exposure(i));
        // A constant rate is part of the mean rate.
        const auto [low, high] = std::minmax_element(values.begin(), values.end());
        if (!(*high > *low)) continue;
        columns.push_back({.effect = effect,
                           .name = std::string(parameter_of(*effect, effects::Role::size).name),
                           .series = shared(std::move(values))});
    }
    return columns;
}

std::vector<SampleCandidate> screen_samples(const SampleFit& now, const SampleContext& in) {
    std::vector<SampleCandidate> out;
    screen_rates(now, in, out);
    screen_noises(now, in, out);
    if (in.slow) return out;
    screen_lines(now, in, out);
    screen_witnesses(now, in, out);
    screen_source(now, in, out);
    return out;
}

}  // namespace ringlock::closure
