#include "analysis/closure/samples/loop/contest.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/steps.hpp"
#include "analysis/closure/samples/loop/competing_tests.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/interrupt.hpp"

namespace ringlock::closure {

bool passes_on_samples(double p_value) { return p_value * effects_on_samples() < options.level_of_effects; }

namespace {

bool shows(const SampleCandidate& candidate, OnSamples as) { return on_samples(*candidate.effect) == as; }

double p_of_gain(double gain, const SampleCandidate& candidate) {
    return of_several(chi2_tail(2.0 * gain, candidate.freedom), candidate.look_elsewhere);
}

/// Compares all effects that may be added to one state of the model.
class Contest {
   public:
    Contest(const record::Declared& declared, const SampleState& now, const Rows& known, double lattice_arcsec)
        : declared_(declared),
          series_(now.fit->series()),
          rows_(now.fit->rows()),
          known_(known),
          now_(now),
          lattice_arcsec_(lattice_arcsec) {}

    SampleChoice choose();

   private:
    using Shared = std::shared_ptr<SampleCandidate>;
    enum class Wanted { all, slow };
    /// A candidate model: one effect, or several, each fitted with those before it.
    struct CandidateSet {
        std::vector<Shared> members;
        double evidence = 0.0;
        double p_value = 1.0;  ///< of the first, given the second

        bool has(const effects::Effect* effect) const;
        bool has(OnSamples as) const;
        bool random() const;
    };

    std::vector<SampleCandidate> screened(const SampleState& state, Wanted wanted) const;
    Shared fitted(const SampleState& state, SampleCandidate candidate) const;
    Shared judged(const SampleState& state, SampleCandidate candidate, SampleFit fit) const;
    Shared placed(Shared first, const SampleModel& all) const;
    void add_weak_random(const std::vector<SampleCandidate>& candidates, const std::vector<Shared>& all, double least,
                         std::vector<CandidateSet>& as_likely) const;
    std::vector<Shared> finalists(const SampleState& state, std::vector<SampleCandidate> candidates) const;
    SampleState with_finalist(const SampleState& state, const SampleCandidate& finalist) const;
    std::vector<CandidateSet> sets(const std::vector<Shared>& all,
                                   const std::vector<SampleCandidate>& candidates) const;
    std::vector<CandidateSet> sets_from(const Shared& first, const std::vector<Shared>& firsts,
                                        const std::vector<SampleCandidate>& candidates) const;
    double p_given_first(const SampleCandidate& first, const SampleCandidate& second, const std::vector<Shared>& firsts,
                         const std::vector<SampleCandidate>& candidates) const;
    static double evidence_to_exceed(const CandidateSet& set, const std::vector<CompetingTest>& competing_tests,
                                     std::size_t rows);
    bool improve_each_other(const SampleCandidate& a, const SampleCandidate& b) const;
    Shared set_aside(std::vector<Shared>& all, const std::vector<CompetingTest>& against) const;
    static Shared nearest(const std::vector<Shared>& all, const Shared& unnamed);
    void tie_sources(SampleChoice& choice) const;
    static void tie(const CandidateSet& best, const std::vector<CandidateSet>& as_likely, SampleChoice& choice);

    const record::Declared& declared_;
    const SampleSeries& series_;
    const Rows& rows_;
    const Rows& known_;
    const SampleState& now_;
    double lattice_arcsec_;
};

bool Contest::CandidateSet::has(const effects::Effect* effect) const {
    return std::any_of(members.begin(), members.end(), [&](const Shared& m) { return m->effect == effect; });
}

bool Contest::CandidateSet::has(OnSamples as) const {
    return std::any_of(members.begin(), members.end(), [&](const Shared& m) { return shows(*m, as); });
}

bool Contest::CandidateSet::random() const {
    return std::any_of(members.begin(), members.end(), [](const Shared& m) { return is_random_rate(*m->effect); });
}

std::vector<SampleCandidate> Contest::screened(const SampleState& state, Wanted wanted) const {
    auto candidates = screen_samples(
        *state.fit, {declared_, series_, rows_, state.lines_hz, state.step, wanted == Wanted::slow, state.source});
    if (!state.random_rates) {
        std::erase_if(candidates, [](const SampleCandidate& c) { return is_random_rate(*c.effect); });
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const auto& a, const auto& b) { return a.p_value < b.p_value; });
    return candidates;
}

Contest::Shared Contest::fitted(const SampleState& state, SampleCandidate candidate) const {
    SampleFit fit(series_, candidate.model, rows_, candidate.noise);
    // The times of steps were found with the noise so far, of which a large effect was a part, and without that effect.
    const auto& columns = fit.model().columns;
    const bool steps = std::any_of(columns.begin(), columns.end(), [&](const SampleColumn& column) {
        return is_step(column) && column.step >= now_.step;
    });
    if (steps && fit.gain_over(*state.fit) > options.samples.contest.placed_again) {
        fit = refine_steps(place_in_gaps(std::move(fit), rows_, known_), rows_);
    }
    return judged(state, std::move(candidate), std::move(fit));
}

Contest::Shared Contest::judged(const SampleState& state, SampleCandidate candidate, SampleFit fit) const {
    candidate.fit = std::make_shared<SampleFit>(std::move(fit));
    const double gain = candidate.fit->gain_over(*state.fit);
    candidate.evidence = gain - std::log(candidate.positions.value_or(candidate.look_elsewhere)) - candidate.parameters;
    // The score tests use the noise so far; the gain of the effect is that of a full fit.
    candidate.passes = candidate.evidence > 0.0 && passes_on_samples(p_of_gain(gain, candidate));
    return std::make_shared<SampleCandidate>(std::move(candidate));
}

/// A step that was chosen in a set is placed at its time in the whole set, which differs from that of the step alone.
Contest::Shared Contest::placed(Shared first, const SampleModel& all) const {
    if (!shows(*first, OnSamples::step)) return first;
    SampleModel model = first->fit->model();
    const auto step = std::find_if(model.columns.begin(), model.columns.end(), is_step);
    const auto there = std::find_if(all.columns.begin(), all.columns.end(), is_step);
    if (step == model.columns.end() || there == all.columns.end()) return first;
    step->series = there->series;
    return judged(now_, *first, SampleFit(series_, std::move(model), rows_, SampleFit::Noise::near));
}

/// Candidates of the score tests that pass when they are fitted in full, the most likely first. Slow rates and lines
/// are fitted at weaker scores as well, since the noise of the score tests may have absorbed them.
std::vector<Contest::Shared> Contest::finalists(const SampleState& state,
                                                std::vector<SampleCandidate> candidates) const {
    std::erase_if(candidates, [](const SampleCandidate& candidate) {
        const bool worth = (is_slow_rate(*candidate.effect) || is_line(*candidate.effect)) &&
                           candidate.p_value < options.samples.contest.worth_looking;
        return !passes_on_samples(candidate.p_value) && !worth;
    });
    // Fits of resampling take long, and all rates explain nearly the same: where the most likely rates, with either
    // kind of errors, are far from the leader, the others are as well.
    const SampleContestOptions& by = options.samples.contest;
    const auto resampled = [](const SampleCandidate& c) { return shows(c, OnSamples::transport); };
    std::vector<SampleCandidate> later;
    std::size_t rates = 0;
    std::erase_if(candidates, [&](SampleCandidate& candidate) {
        if (!resampled(candidate) || rates++ < by.first_sources) return false;
        later.push_back(std::move(candidate));
        return true;
    });
    std::vector<Shared> all;
    const auto fit_all = [&](std::vector<SampleCandidate> some) {
        const std::size_t first = all.size();
        all.resize(first + some.size());
        oneapi::tbb::parallel_for(std::size_t{0}, some.size(),
                                  [&](std::size_t k) { all[first + k] = fitted(state, std::move(some[k])); });
    };
    fit_all(std::move(candidates));
    double most = 0.0;
    double most_resampled = 0.0;
    for (const Shared& finalist : all) {
        if (is_slow_rate(*finalist->effect)) continue;
        double& of_these = resampled(*finalist) ? most_resampled : most;
        of_these = std::max(of_these, finalist->evidence);
    }
    if (!(most_resampled > 0.0 && most_resampled < by.far * most)) fit_all(std::move(later));
    std::erase_if(all, [](const Shared& finalist) { return !finalist->passes; });
    std::sort(all.begin(), all.end(), [](const Shared& a, const Shared& b) { return a->evidence > b->evidence; });
    // Rates of a source take no place from other candidates.
    std::size_t count = 0;
    std::size_t count_resampled = 0;
    std::erase_if(all, [&](const Shared& finalist) {
        std::size_t& of_these = resampled(*finalist) ? count_resampled : count;
        return of_these++ >= options.most_finalists + by.more_finalists;
    });
    return all;
}

SampleState Contest::with_finalist(const SampleState& state, const SampleCandidate& finalist) const {
    return {finalist.fit, state.lines_hz, state.step + 1, state.random_rates, state.source};
}

/// Probability of the gain by the first over the second alone; of the gain by both, if the first does not pass alone.
double Contest::p_given_first(const SampleCandidate& first, const SampleCandidate& second,
                              const std::vector<Shared>& firsts, const std::vector<SampleCandidate>& candidates) const {
    const double others = 0.5 * (effects_on_samples() - 1.0);  // of all pairs, for each effect
    const effects::Effect* effect = second.effect;
    const auto fitted_already =
        std::find_if(firsts.begin(), firsts.end(), [&](const Shared& c) { return c->effect == effect; });
    std::shared_ptr<SampleFit> alone;
    if (fitted_already != firsts.end()) {
        alone = (*fitted_already)->fit;
    } else {
        const auto same = std::find_if(candidates.begin(), candidates.end(),
                                       [&](const SampleCandidate& c) { return c.effect == effect; });
        if (same == candidates.end()) return first.passes ? first.p_value : 1.0;
        alone = fitted(now_, *same)->fit;
    }
    const double p = p_of_gain(second.fit->gain_over(*alone), first);
    if (first.passes) return p;
    const double both = second.fit->gain_over(*now_.fit);
    return std::max(p, of_several(chi2_tail(2.0 * both, first.freedom + second.freedom),
                                  others * first.look_elsewhere * second.look_elsewhere));
}

/// Sets that start from one effect: with the most likely random rate; with the most likely other rate; and with that
/// and the most likely third.
std::vector<Contest::CandidateSet> Contest::sets_from(const Shared& first, const std::vector<Shared>& firsts,
                                                      const std::vector<SampleCandidate>& candidates) const {
    // Cost of the choice among so many other effects.
    const double choice = std::log(effects_on_samples());
    std::vector<CandidateSet> found;
    const SampleState with_first = with_finalist(now_, *first);
    const auto seconds = finalists(with_first, screened(with_first, Wanted::slow));
    for (const bool random : {false, true}) {
        const auto second = std::find_if(seconds.begin(), seconds.end(), [&](const Shared& c) {
            return is_slow_rate(*c->effect) && is_random_rate(*c->effect) == random;
        });
        if (second == seconds.end()) continue;
        const double p = p_given_first(*first, **second, firsts, candidates);
        if (!passes_on_samples(p)) continue;
        const double evidence = first->evidence + (*second)->evidence - choice;
        found.push_back({{first, *second}, evidence, p});
        if (random || is_random_rate(*first->effect)) continue;
        const SampleState with_both = with_finalist(with_first, **second);
        for (const Shared& third : finalists(with_both, screened(with_both, Wanted::slow))) {
            if (!is_slow_rate(*third->effect) || is_random_rate(*third->effect)) continue;
            found.push_back({{first, *second, third}, evidence + third->evidence - choice, p});
            break;
        }
    }
    return found;
}

/// Sets of slow rates. Several effects together may explain more than a random rate or a residual test where each alone
/// explains less, and one may hide another: the first need not pass alone if it does with the second.
std::vector<Contest::CandidateSet> Contest::sets(const std::vector<Shared>& all,
                                                 const std::vector<SampleCandidate>& candidates) const {
    const std::size_t starts = options.samples.contest.set_starts;
    std::vector<Shared> firsts;
    bool random = false;
    for (const Shared& finalist : all) {
        if (!is_slow_rate(*finalist->effect)) continue;
        // One random rate can substitute for another.
        if (is_random_rate(*finalist->effect) && std::exchange(random, true)) continue;
        firsts.push_back(finalist);
    }
    for (const SampleCandidate& candidate : candidates) {
        const bool known =
            std::any_of(all.begin(), all.end(), [&](const Shared& c) { return c->effect == candidate.effect; });
        if (known || !is_slow_rate(*candidate.effect) || is_random_rate(*candidate.effect)) continue;
        if (candidate.p_value < options.samples.contest.worth_looking) firsts.push_back(fitted(now_, candidate));
    }
    std::sort(firsts.begin(), firsts.end(), [](const Shared& a, const Shared& b) { return a->evidence > b->evidence; });
    if (firsts.size() > starts + (random ? 1 : 0)) firsts.resize(starts + (random ? 1 : 0));
    std::vector<std::vector<CandidateSet>> found(firsts.size());
    oneapi::tbb::parallel_for(std::size_t{0}, firsts.size(),
                              [&](std::size_t k) { found[k] = sets_from(firsts[k], firsts, candidates); });
    std::vector<CandidateSet> candidate_sets;
    for (auto& some : found) std::move(some.begin(), some.end(), std::back_inserter(candidate_sets));
    return candidate_sets;
}

/// Evidence that a set must exceed: where a residual test explains more, the set only substitutes for a cause that is
/// not in the library. A residual test is preferred to an effect if it explains more by the margins below.
double Contest::evidence_to_exceed(const CandidateSet& set, const std::vector<CompetingTest>& competing_tests,
                                   std::size_t rows) {
    const bool random = set.random();
    const bool moves = std::all_of(set.members.begin(), set.members.end(), [](const Shared& member) {
        return is_slow_rate(*member->effect) || is_line(*member->effect);
    });
    double most = 0.0;
    for (const CompetingTest& competing : competing_tests) {
        // A varying size of the noise does not look like a rate or a line, nor do these look like it.
        if (competing.repeats && moves) continue;
        // A line is not explained by another one that is far from it.
        const SampleCandidate& first = *set.members.front();
        if (competing.hz && set.members.size() == 1 && is_line(*first.effect) &&
            std::abs(*competing.hz - first.hz) > options.samples.lines.adjacent_hz) {
            continue;
        }
        double evidence = set.has(OnSamples::motion) ? competing.of_a_motion : competing.evidence;
        // A line of constant phase, or interpolation of readings, leaves no power of a strong line; a resonance follows
        // any line.
        const bool keeps = is_line(*first.effect) ? !first.wanders : shows(first, OnSamples::transport);
        if (keeps && competing.by_variance) evidence = *competing.by_variance;
        if (competing.repeats && set.has(OnSamples::transport)) {
            // Interpolation on straight lines makes the variance oscillate by one half exactly. Blur reduces that, and
            // any other oscillation may be smaller as well.
            const SampleNoise& noise = set.members.front()->fit->model().noise;
            evidence +=
                noise.blur_arcsec < options.samples.contest.blurred * noise.angle_arcsec ? -options.tie : options.tie;
            most = std::max(most, evidence);
            continue;
        }
        // A set is chosen from many: against a test of another column of the record it has no margin for being in the
        // library. A trend in time follows all columns.
        double more = set.members.size() > 1 && competing.where != Where::time ? 0.0 : -options.tie;
        // The likelihood of a random process is integrated over its path: the coefficients of a trend in time must be
        // integrated out as well (Schwarz 1978).
        if (random) evidence -= competing.trends * (0.5 * std::log(static_cast<double>(rows)) - 1.0);
        if (random && (competing.where != Where::time || competing.jumps)) {
            // A random rate can follow jumps, or another column of the record, nearly as well as their regression. The
            // times of jumps are searched stretch by stretch, which loses a part of their gain.
            more = competing.jumps ? std::max(options.tie, options.samples.contest.lost_of_jumps * set.evidence)
                                   : options.tie;
        } else if (!random && competing.jumps && set.members.size() > 1) {
            more = options.tie;
        }
        most = std::max(most, evidence + more);
        // A chain of states is a random process as well: within a tie the record does not distinguish it from a random
        // rate.
        if (competing.of_states) most = std::max(most, *competing.of_states + (random ? options.tie : -options.tie));
    }
    return most;
}

/// Adds a random rate that does not pass by itself to the candidates as likely as a trend. In a short record they
/// differ by little: a random walk that shows as one slow change passes as a trend first.
void Contest::add_weak_random(const std::vector<SampleCandidate>& candidates, const std::vector<Shared>& all,
                              double least, std::vector<CandidateSet>& as_likely) const {
    const double duration_s = series_.interval_s * static_cast<double>(series_.size());
    if (duration_s >= options.samples.contest.trend_determined_s) return;
    for (const SampleCandidate& candidate : candidates) {
        if (!is_random_rate(*candidate.effect)) continue;
        const bool known =
            std::any_of(all.begin(), all.end(), [&](const Shared& c) { return c->effect == candidate.effect; });
        if (known) continue;
        const Shared weak = fitted(now_, candidate);
        if (weak->evidence > least) as_likely.push_back({{weak}, weak->evidence, weak->p_value});
    }
}

/// True if one of two effects of different kinds still improves the fit when the other is present. Two such effects are
/// not alternatives, even if their evidence is equal.
bool Contest::improve_each_other(const SampleCandidate& a, const SampleCandidate& b) const {
    const auto kind = [](const SampleCandidate& finalist) {
        const effects::Effect& effect = *finalist.effect;
        return is_slow_rate(effect) ? 0 : is_line(effect) ? 1 : 2;
    };
    if (kind(a) == kind(b)) return false;
    for (const auto& [with, without] : {std::pair{&a, &b}, std::pair{&b, &a}}) {
        std::vector<std::vector<double>> added;
        for (const SampleColumn& column : with->fit->model().columns) {
            if (column.step != now_.step) continue;
            added.push_back(without->fit->taken(column));
        }
        if (!added.empty()) return 0.5 * without->fit->score(added).chi2 > options.tie;
    }
    const SampleCandidate& random = is_random_rate(*a.effect) ? a : b;
    const SampleCandidate& other = is_random_rate(*a.effect) ? b : a;
    if (!is_random_rate(*random.effect)) return false;
    SampleModel model = other.fit->model();
    const SampleModel& rates = random.fit->model();
    model.walk = rates.walk;
    model.flicker = rates.flicker;
    model.flicker_deg_h = rates.flicker_deg_h;
    model.noise.walk_arcsec2_s3 = rates.noise.walk_arcsec2_s3;
    model.noise.terms = rates.noise.terms;
    const SampleFit both(series_, std::move(model), rows_, SampleFit::Noise::near);
    return both.gain_over(*other.fit) > options.tie;
}

/// Ties to the chosen effect every effect that explains as much in its place. If a set was chosen, the alternatives are
/// distributed over its members.
void Contest::tie(const CandidateSet& best, const std::vector<CandidateSet>& as_likely, SampleChoice& choice) {
    const effects::Effect* effect = choice.chosen->effect;
    const auto add = [](Effects& all, const effects::Effect* one) {
        if (std::find(all.begin(), all.end(), one) == all.end()) all.push_back(one);
    };
    choice.confounded_with = choice.chosen->confounded;
    for (const Shared& member : best.members) {
        if (member->effect != effect) choice.of_partners.push_back({member->effect, {}});
    }
    for (const CandidateSet& other : as_likely) {
        if (other.has(effect)) {
            // The same effect with another drift, which may have other ties.
            if (other.members.size() > 1) continue;
            for (const effects::Effect* same : other.members.front()->confounded) {
                add(choice.confounded_with, same);
            }
            continue;
        }
        Effects instead;
        for (const Shared& member : other.members) {
            if (!best.has(member->effect)) instead.push_back(member->effect);
        }
        for (auto& [partner, alternatives] : choice.of_partners) {
            if (other.has(partner) || instead.size() < 2) continue;
            add(alternatives, instead.back());
            instead.pop_back();
        }
        for (const effects::Effect* one : instead) add(choice.confounded_with, one);
    }
}

/// Removes candidates that cannot be the answer: those that are not in the library, and resampling where a variance
/// that oscillates explains more.
/// \return the most likely candidate that is not in the library, or null
Contest::Shared Contest::set_aside(std::vector<Shared>& all, const std::vector<CompetingTest>& against) const {
    Shared unnamed;
    std::erase_if(all, [&](const Shared& finalist) {
        if (finalist->placeholder && !unnamed) unnamed = finalist;
        return finalist->placeholder;
    });
    // A variance that oscillates otherwise than on straight lines is no resampling.
    if (all.empty() || !shows(*all.front(), OnSamples::transport)) return unnamed;
    std::vector<CompetingTest> repeats = against;
    std::erase_if(repeats, [](const CompetingTest& competing) { return !competing.repeats; });
    if (all.front()->evidence >
        evidence_to_exceed({{all.front()}, all.front()->evidence, 0.0}, repeats, series_.size()))
        return unnamed;
    std::erase_if(all, [](const Shared& finalist) { return shows(*finalist, OnSamples::transport); });
    return unnamed;
}

/// The effect to be used as a placeholder where nothing can be chosen: the closest to an unknown rate or line, or null.
Contest::Shared Contest::nearest(const std::vector<Shared>& all, const Shared& unnamed) {
    if (all.empty() || (unnamed && unnamed->evidence > all.front()->evidence)) return unnamed;
    const effects::Effect& leader = *all.front()->effect;
    if (is_line(leader)) return all.front();
    if (!is_slow_rate(leader)) return unnamed;
    const auto random =
        std::find_if(all.begin(), all.end(), [](const Shared& c) { return is_random_rate(*c->effect); });
    return random == all.end() ? unnamed : *random;
}

/// Readings at k times the record's rate plus or minus the same difference leave the same pattern in the record. A fit
/// at each of these rates shows whether the noise distinguishes them. Above twice the record's rate it does not:
/// readings between which there is no sample leave no trace.
void Contest::tie_sources(SampleChoice& choice) const {
    const SampleModel& chosen = choice.chosen->fit->model();
    const double from_hz = chosen.noise.from_hz;
    const double distinguished_up_to_hz = options.samples.contest.distinguished_up_to * series_.rate_hz;
    for (const SamePattern& pattern : with_same_pattern(from_hz, series_.rate_hz)) {
        if (same_source(pattern.hz, from_hz, series_.rate_hz)) continue;
        check_interrupt();
        SampleNoise noise = chosen.noise;
        noise.from_hz = pattern.hz;
        noise.from_phase = phase_of(pattern, chosen.noise.from_phase);
        const SampleFit other(series_, resampled_with(*now_.fit, noise), choice.chosen->fit->rows(),
                              SampleFit::Noise::free);
        const bool beyond = from_hz > distinguished_up_to_hz && pattern.hz > distinguished_up_to_hz;
        if (beyond || choice.chosen->fit->gain_over(other) < options.tie) choice.other_hz.push_back(pattern.hz);
    }
    std::sort(choice.other_hz.begin(), choice.other_hz.end());
}

SampleChoice Contest::choose() {
    const auto candidates = screened(now_, Wanted::all);
    auto all = finalists(now_, candidates);
    std::vector<CompetingTest> against;
    const auto may_be_of = [&](OnSamples as) {
        return std::any_of(all.begin(), all.end(), [as](const Shared& c) { return shows(*c, as); });
    };
    if (!all.empty()) {
        against = competing_tests_of(*now_.fit, lattice_arcsec_, may_be_of(OnSamples::transport),
                                     may_be_of(OnSamples::motion));
    }
    const auto holds = [&](const CandidateSet& set) {
        return set.evidence > evidence_to_exceed(set, against, series_.size());
    };
    const Shared unnamed = set_aside(all, against);
    std::vector<CandidateSet> candidate_sets;
    for (const Shared& finalist : all) {
        candidate_sets.push_back({{finalist}, finalist->evidence, finalist->p_value});
    }
    const bool led = !all.empty() && holds(candidate_sets.front());
    const double leader = all.empty() ? 0.0 : candidate_sets.front().evidence;
    const bool random_leads = !all.empty() && candidate_sets.front().random();
    if (!led || is_slow_rate(*all.front()->effect)) {
        for (CandidateSet& set : sets(all, candidates)) candidate_sets.push_back(std::move(set));
        if (all.empty() && !candidate_sets.empty())
            against = competing_tests_of(*now_.fit, lattice_arcsec_, false, false);
    }
    std::stable_sort(candidate_sets.begin(), candidate_sets.end(),
                     [](const CandidateSet& a, const CandidateSet& b) { return a.evidence > b.evidence; });
    // Where a residual test explains more than the most likely effect, another effect must be as likely and explain
    // more than every test by far, and a set must be far better than that effect.
    const auto may_be = [&](const CandidateSet& set) {
        if (led || all.empty()) return holds(set);
        if (set.members.size() > 1) {
            // A random rate that does not exceed the residual tests comes near to any structure.
            const double more = random_leads && !set.random() ? 0.0 : options.tie;
            return set.evidence > leader + more && holds(set);
        }
        return set.evidence >
               std::max(leader - options.tie, evidence_to_exceed(set, against, series_.size()) + options.tie);
    };
    // The smallest number of effects that explains as much as any.
    const CandidateSet* best = nullptr;
    double least = 0.0;
    for (const CandidateSet& set : candidate_sets) {
        if (!(set.evidence > least) || !may_be(set)) continue;
        if (best == nullptr) least = std::max(least, set.evidence - options.tie);
        if (best == nullptr || set.members.size() < best->members.size()) best = &set;
    }
    if (best == nullptr) {
        SampleChoice none;
        none.nearest = nearest(all, unnamed);
        return none;
    }
    const bool slow = best->members.size() == 1 && !best->random() && is_slow_rate(*best->members.front()->effect);
    const double least_random = slow ? std::max(0.0, best->evidence - options.tie_with_random) : least;
    std::vector<CandidateSet> as_likely;
    for (const CandidateSet& set : candidate_sets) {
        const bool tied_random = set.members.size() == 1 && set.random() && set.evidence > least_random;
        if (set.evidence > least || tied_random) as_likely.push_back(set);
    }
    if (slow) add_weak_random(candidates, all, least_random, as_likely);
    SampleChoice choice;
    // The effect of a set that most of the equally likely candidate models contain is added first.
    std::ptrdiff_t most = -1;
    for (const Shared& member : best->members) {
        const effects::Effect* effect = member->effect;
        const auto same = std::find_if(candidates.begin(), candidates.end(),
                                       [&](const SampleCandidate& c) { return c.effect == effect; });
        if (member != best->members.front() && same == candidates.end()) continue;
        const auto in =
            std::count_if(as_likely.begin(), as_likely.end(), [&](const CandidateSet& set) { return set.has(effect); });
        if (in <= most) continue;
        most = in;
        const bool first = member == best->members.front();
        choice.chosen = first ? member : fitted(now_, *same);
        choice.p_value = first ? best->p_value : member->p_value;
    }
    if (best->members.size() > 1) choice.chosen = placed(choice.chosen, best->members.back()->fit->model());
    std::erase_if(as_likely, [&](const CandidateSet& set) {
        return set.members.size() == 1 && improve_each_other(*choice.chosen, *set.members.front());
    });
    tie(*best, as_likely, choice);
    if (is_random_rate(*choice.chosen->effect)) {
        const auto other = std::find_if(all.begin(), all.end(), [&](const Shared& c) {
            return is_random_rate(*c->effect) && c->effect != choice.chosen->effect;
        });
        if (other != all.end()) choice.other_random = *other;
    }
    if (shows(*choice.chosen, OnSamples::transport)) {
        if (now_.source != nullptr) {
            choice.other_hz = now_.source->other_hz;
        } else {
            tie_sources(choice);
        }
    }
    return choice;
}

}  // namespace

SampleChoice choose_on_samples(const record::Declared& declared, const SampleState& now, const Rows& known,
                               double lattice_arcsec) {
    return Contest(declared, now, known, lattice_arcsec).choose();
}

}  // namespace ringlock::closure
