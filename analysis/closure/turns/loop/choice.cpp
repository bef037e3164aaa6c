#include "analysis/closure/turns/loop/choice.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/loop/candidate_fit.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"

namespace ringlock::closure {

namespace {

/// A candidate, or one with others that are added next.
struct CandidateSet {
    const Candidate* first = nullptr;
    std::vector<Candidate> others = {};
    std::shared_ptr<Fitted> fitted = {};
    double evidence = 0.0;
    double p_value = 1.0;  ///< of the first, with the others in the model

    EffectSet effects() const {
        EffectSet set{{first->effect}, evidence};
        for (const Candidate& candidate : others) set.effects.push_back(candidate.effect);
        return set;
    }
    bool has_all_of(const CandidateSet& other) const {
        const EffectSet mine = effects();
        const EffectSet theirs = other.effects();
        return std::all_of(theirs.effects.begin(), theirs.effects.end(),
                           [&](const effects::Effect* effect) { return mine.has(effect); });
    }
    long random_rates() const {
        const EffectSet mine = effects();
        return std::count_if(mine.effects.begin(), mine.effects.end(),
                             [](const effects::Effect* effect) { return is_random_rate(*effect); });
    }
};

/// Pairs of each of the most likely candidates, random or not, with the effect that explains most of its residual, and
/// pairs of random rates. Both members must be needed.
std::vector<CandidateSet> pairs(const TurnProblem& problem, const std::vector<Candidate>& candidates) {
    const TurnOptions::Loop& limits = options.turns.loop;
    std::vector<CandidateSet> sets;
    const auto add = [&](const Candidate& first, const std::shared_ptr<Fitted>& both, const Candidate& second) {
        const auto alone = std::find_if(candidates.begin(), candidates.end(),
                                        [&](const Candidate& c) { return c.effect == second.effect; });
        double p_value = first.p_value;
        if (alone != candidates.end()) p_value = p_of_fit(*both, *alone->fitted, first);
        if (!passes(p_value) || !passes(p_of_fit(*both, *first.fitted, second))) return;
        const double evidence = evidence_of(gain_over(*both, *first.fitted), *both, *second.effect);
        both->fit->release();
        sets.push_back({&first, {second}, both, first.evidence + evidence - cost_of_choice(), p_value});
    };
    std::vector<const Candidate*> firsts;
    std::vector<const Candidate*> random;
    std::size_t tried = 0;
    for (const Candidate& candidate : candidates) {
        // Sets with an effect that contains another one explain hardly more than the sets with the other one.
        if (contains_one_of(*candidate.effect, candidates)) continue;
        const bool is_random = is_random_rate(*candidate.effect);
        if (is_random ? !passes(candidate.p_value) : ++tried > limits.first_of_pair) continue;
        firsts.push_back(&candidate);
        if (is_random) random.push_back(&candidate);
    }
    struct RatePair {
        const Candidate* first;
        const Candidate* second;
        std::shared_ptr<Fitted> both = {};
    };
    std::vector<RatePair> of_random;
    for (std::size_t a = 0; a < random.size(); ++a) {
        for (std::size_t b = a + 1; b < random.size(); ++b) of_random.push_back({random[a], random[b]});
    }
    std::vector<Ranking> seconds(firsts.size());
    // One after the other: each ranking is parallel in itself, and holds a fit of the record meanwhile.
    for (std::size_t k = 0; k < firsts.size(); ++k) {
        seconds[k] = rank_candidates(problem, *firsts[k]->fitted, limits.second_of_pair, Among::not_random,
                                     candidates.front().evidence - firsts[k]->evidence);
    }
    side_by_side(of_random.size(), [&](std::size_t k) {
        RatePair& pair = of_random[k];
        TurnParameters start = pair.first->fitted->parameters();
        start.effects.push_back(*pair.second->fitted->parameters().find(pair.second->effect->name()));
        pair.both = problem.fit_or_none(start);
        if (pair.both) pair.both->fit->release();
    });
    for (std::size_t k = 0; k < firsts.size(); ++k) {
        if (seconds[k].seen_in_other_columns) continue;
        for (const Candidate& second : seconds[k].candidates) add(*firsts[k], second.fitted, second);
    }
    for (const RatePair& pair : of_random) {
        if (pair.both) add(*pair.first, pair.both, *pair.second);
    }
    return sets;
}

/// The most likely pairs with a third effect. A random rate can follow three other effects at once, or hide jumps next
/// to another random rate. Only sets as good as the best one are returned, in which each effect is needed.
/// \param sets  by decreasing evidence
std::vector<CandidateSet> triples(const TurnProblem& problem, const std::vector<Candidate>& candidates,
                                  const std::vector<CandidateSet>& sets) {
    const TurnOptions::Loop& limits = options.turns.loop;
    const double best = sets.front().evidence;
    std::vector<const CandidateSet*> extended;
    for (const long random : {0L, 1L}) {
        const auto likeliest = std::find_if(sets.begin(), sets.end(), [&](const CandidateSet& set) {
            // An effect that contains another one substitutes for much that a third effect would explain.
            const EffectSet all = set.effects();
            const bool of_smallest = std::none_of(all.effects.begin(), all.effects.end(), [&](const auto* effect) {
                return contains_one_of(*effect, candidates);
            });
            return set.others.size() == 1 && set.random_rates() == random && of_smallest;
        });
        if (likeliest == sets.end()) continue;
        // The residual of a pair with one random rate is searched after it has been added, except for effects that a
        // second random rate would hide.
        const bool may_win =
            random == 0 ? likeliest->evidence > limits.most_of_evidence * best : !sets.front().others.empty();
        if (may_win) extended.push_back(&*likeliest);
    }
    std::vector<std::vector<CandidateSet>> found(extended.size());
    for (std::size_t k = 0; k < extended.size(); ++k) {
        const CandidateSet& pair = *extended[k];
        const Ranking ranking =
            rank_candidates(problem, *pair.fitted, limits.third_of_triple, Among::all, best - pair.evidence);
        if (ranking.seen_in_other_columns) continue;
        for (const Candidate& third : ranking.candidates) {
            const double evidence = pair.evidence + third.evidence - cost_of_choice();
            if (!(evidence > best - options.tie) || !passes(third.p_value)) continue;
            const auto p_given_others = [&](const Candidate& candidate) {
                TurnParameters without = third.fitted->parameters();
                std::erase_if(without.effects,
                              [&](const ActiveEffect& active) { return active.effect == candidate.effect; });
                const auto fitted = problem.fit_or_none(without);
                return fitted ? p_of_fit(*third.fitted, *fitted, candidate) : 1.0;
            };
            const double p_value = p_given_others(*pair.first);
            if (!passes(p_value) || !passes(p_given_others(pair.others.front()))) continue;
            found[k].push_back({pair.first, {pair.others.front(), third}, third.fitted, evidence, p_value});
        }
    }
    std::vector<CandidateSet> all;
    for (std::vector<CandidateSet>& some : found) {
        for (CandidateSet& set : some) {
            const bool known =
                std::any_of(all.begin(), all.end(), [&](const CandidateSet& other) { return other.has_all_of(set); });
            if (!known) all.push_back(std::move(set));
        }
    }
    return all;
}

/// All sets that may be chosen, by decreasing evidence.
std::vector<CandidateSet> sets_of(const TurnProblem& problem, const Ranking& ranking) {
    std::vector<CandidateSet> sets;
    for (const Candidate& candidate : ranking.candidates) {
        sets.push_back({&candidate, {}, candidate.fitted, candidate.evidence, candidate.p_value});
    }
    const auto sort = [&] {
        std::stable_sort(sets.begin(), sets.end(),
                         [](const CandidateSet& a, const CandidateSet& b) { return a.evidence > b.evidence; });
    };
    if (!ranking.seen_in_other_columns && is_random_rate(*ranking.candidates.front().effect)) {
        for (CandidateSet& pair : pairs(problem, ranking.candidates)) sets.push_back(std::move(pair));
        sort();
        for (CandidateSet& triple : triples(problem, ranking.candidates, sets)) sets.push_back(std::move(triple));
    }
    sort();
    return sets;
}

/// A deterministic rate may be more likely than the random rate that generated the record.
void tie_random_rates(const Ranking& ranking, double evidence, std::vector<const effects::Effect*>& tied) {
    for (const Candidate& candidate : ranking.candidates) {
        const bool known = std::find(tied.begin(), tied.end(), candidate.effect) != tied.end();
        if (!is_random_rate(*candidate.effect) || known) continue;
        if (candidate.evidence > std::max(0.0, evidence - options.tie_with_random)) tied.push_back(candidate.effect);
    }
}

}  // namespace

Choice choose(const TurnProblem& problem, const Ranking& ranking) {
    Choice choice;
    const auto& candidates = ranking.candidates;
    if (candidates.empty() || !passes(candidates.front().p_value)) return choice;
    std::vector<CandidateSet> sets = sets_of(problem, ranking);
    const CandidateSet best = sets.front();
    std::vector<EffectSet> tied;
    for (const CandidateSet& set : sets) {
        if (set.evidence > best.evidence - options.tie) tied.push_back(set.effects());
    }
    const auto alone = [&](const effects::Effect* effect) {
        return std::find_if(candidates.begin(), candidates.end(),
                            [&](const Candidate& c) { return c.effect == effect && passes(c.p_value); });
    };
    Naming naming = name_among(tied, [&](const effects::Effect* e) { return alone(e) != candidates.end(); });
    const bool leads = naming.named == best.first->effect;
    choice.chosen = leads ? best.first : &*alone(naming.named);
    choice.p_value = leads ? best.p_value : choice.chosen->p_value;
    choice.on_random = best.random_rates() > 0;
    choice.partners = std::move(naming.partners);
    choice.alternatives = std::move(naming.alternatives);
    for (std::size_t k = 1; k < choice.alternatives.size(); ++k) {
        choice.confounded_with.push_back(choice.alternatives[k].effect);
    }
    const effects::Effect& chosen = *choice.chosen->effect;
    if (best.others.empty() && chosen.adds_angle() && !is_random_rate(chosen)) {
        tie_random_rates(ranking, best.evidence, choice.confounded_with);
    }
    return choice;
}

}  // namespace ringlock::closure
