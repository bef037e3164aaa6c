#include "analysis/closure/turns/loop/ranking.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/loop/candidate_fit.hpp"
#include "analysis/closure/turns/model/effect_roles.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "analysis/closure/turns/screen/side_channels.hpp"

namespace ringlock::closure {

namespace {

/// Score tests under the fitted noise, which may have absorbed part of an effect, and under less noise, which may show
/// more of it. They only select candidates for full fits.
std::vector<Candidate> screen_by_any_noise(const TurnFit& fit) {
    std::vector<Candidate> candidates = screen(fit);
    const auto less = fit.with_less_noise();
    if (!less) return candidates;
    for (Candidate& other : screen(*less)) {
        if (is_random_rate(*other.effect) || !passes(other.p_value)) continue;
        const auto same = std::find_if(candidates.begin(), candidates.end(),
                                       [&](const Candidate& c) { return c.effect == other.effect; });
        if (same == candidates.end()) {
            candidates.push_back(std::move(other));
        } else if (other.chi2 > same->chi2) {
            *same = std::move(other);
        }
    }
    return candidates;
}

/// The candidates worth a full fit, the most likely first: `most` of them, and in addition random rates and effects
/// that contain one of these.
std::vector<Candidate> worth_a_fit(std::vector<Candidate> candidates, double largest_p, std::size_t most) {
    std::erase_if(candidates, [&](const Candidate& c) { return !(c.p_value < largest_p); });
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return predicted_evidence(a) > predicted_evidence(b); });
    const std::vector<Candidate> all = candidates;
    std::size_t taken = 0;
    std::erase_if(candidates, [&](const Candidate& c) {
        return !is_random_rate(*c.effect) && !contains_one_of(*c.effect, all) && ++taken > most;
    });
    const std::vector<Candidate> kept = candidates;
    std::erase_if(candidates, [&](const Candidate& c) {
        return contains_one_of(*c.effect, all) && !contains_one_of(*c.effect, kept);
    });
    return candidates;
}

/// An effect that changes the phases as they are read is fitted without any other candidate.
void leave_alone_what_changes_the_reading(std::vector<Candidate>& candidates) {
    const bool alone = changes_reading(*candidates.front().effect);
    for (std::size_t k = candidates.size(); k-- > 1;) {
        if (alone || changes_reading(*candidates[k].effect)) {
            candidates.erase(candidates.begin() + static_cast<std::ptrdiff_t>(k));
        }
    }
}

/// The full fits of several candidates, in parallel.
class RankingFits {
   public:
    RankingFits(const TurnProblem& problem, const Fitted& now, std::vector<Candidate>& candidates, bool other_columns,
                double matters)
        : now_(now), candidates_(candidates), other_columns_(other_columns), matters_(matters) {
        for (const Candidate& candidate : candidates) fits_.emplace_back(problem, now, candidate);
        evidences_.resize(candidates.size());
    }

    void fit_all() {
        // The most likely candidate and the most likely random rate are first: the others are compared with them.
        std::vector<std::size_t> first;
        std::vector<std::size_t> others;
        std::vector<std::size_t> larger;  // these contain another candidate, from whose fit they start
        const Candidate* random = nullptr;
        std::size_t first_random = 0;
        for (std::size_t k = 0; k < candidates_.size(); ++k) {
            const bool leads_random = random == nullptr && is_random_rate(*candidates_[k].effect);
            if (leads_random) {
                random = &candidates_[k];
                first_random = k;
            }
            (contained_in(k) ? larger : k == 0 || leads_random ? first : others).push_back(k);
        }
        fit(first, nullptr);
        fit(others, random == nullptr ? nullptr : fits_[first_random].best().get());
        fit(larger, nullptr);
        side_by_side(fits_.size(), [&](std::size_t k) {
            if (!fits_[k].best() || evidences_[k] < options.turns.loop.nearly_best * matters_) return;
            fits_[k].again_if_strong();
            judge(k);
        });
        for (std::size_t k = 0; k < candidates_.size(); ++k) {
            candidates_[k].fitted = fits_[k].best();
            candidates_[k].evidence = evidences_[k];
            if (fits_[k].best() && !other_columns_) {
                candidates_[k].p_value = p_of_fit(*fits_[k].best(), now_, candidates_[k]);
            }
        }
    }

   private:
    void fit(const std::vector<std::size_t>& some, const Fitted* alike) {
        const TurnOptions::Loop& limits = options.turns.loop;
        const double needed =
            matters_ > limits.much_evidence ? limits.far_below * matters_ : -std::numeric_limits<double>::infinity();
        side_by_side(some.size(), [&](std::size_t i) {
            const std::size_t k = some[i];
            const std::optional<std::size_t> smaller = contained_in(k);
            if (smaller && fits_[*smaller].best()) {
                fits_[k].begin_as(*candidates_[*smaller].effect, *fits_[*smaller].best(), needed);
            } else {
                fits_[k].begin(is_random_rate(*candidates_[k].effect) ? alike : nullptr, needed);
            }
            judge(k);
        });
        for (const std::size_t k : some) {
            if (fits_[k].best()) matters_ = std::max(matters_, evidences_[k]);
        }
    }
    /// Another candidate that this one contains.
    std::optional<std::size_t> contained_in(std::size_t k) const {
        for (std::size_t other = 0; other < candidates_.size(); ++other) {
            if (contains(*candidates_[k].effect, *candidates_[other].effect)) return other;
        }
        return std::nullopt;
    }
    void judge(std::size_t k) {
        const auto& best = fits_[k].best();
        if (!best) return;
        const Candidate& candidate = candidates_[k];
        evidences_[k] = other_columns_ ? predicted_evidence(candidate)
                                       : evidence_of(gain_over(*best, now_), *best, *candidate.effect);
        if (!other_columns_ && contained_in(k)) best->fit->estimates();  // needed when all are fitted
        best->fit->release();
    }

    const Fitted& now_;
    std::vector<Candidate>& candidates_;
    bool other_columns_;
    double matters_;
    std::vector<CandidateFit> fits_;
    std::vector<double> evidences_;
};

/// An effect that contains another one is as likely as that one, except for the evidence on its additional sizes.
void compare_with_contained(std::vector<Candidate>& candidates) {
    for (Candidate& larger : candidates) {
        for (const Candidate& smaller : candidates) {
            if (!contains(*larger.effect, *smaller.effect)) continue;
            const auto evidence =
                evidence_for_addition(*larger.effect, *smaller.effect, larger.fitted->fit->estimates(),
                                      gain_over(*larger.fitted, *smaller.fitted));
            if (evidence) larger.evidence = smaller.evidence + *evidence;
        }
    }
}

}  // namespace

bool contains_one_of(const effects::Effect& effect, const std::vector<Candidate>& candidates) {
    return std::any_of(candidates.begin(), candidates.end(),
                       [&](const Candidate& other) { return contains(effect, *other.effect); });
}

Ranking rank_candidates(const TurnProblem& problem, const Fitted& now, std::size_t most, Among among, double matters) {
    Ranking ranking;
    std::vector<Candidate>& candidates = ranking.candidates;
    candidates =
        worth_a_fit(screen_side_channels(problem.turns(), *now.fit, now.joined()), level_of_one_effect(), most);
    ranking.seen_in_other_columns = !candidates.empty();
    if (ranking.seen_in_other_columns) {
        leave_alone_what_changes_the_reading(candidates);
    } else {
        candidates = screen_by_any_noise(*now.fit);
        if (among == Among::not_random) {
            std::erase_if(candidates, [](const Candidate& c) { return is_random_rate(*c.effect); });
        }
        candidates = worth_a_fit(std::move(candidates), options.turns.loop.worth_a_fit_p, most);
    }
    now.fit->release();
    RankingFits(problem, now, candidates, ranking.seen_in_other_columns, matters).fit_all();
    std::erase_if(candidates, [](const Candidate& candidate) { return !candidate.fitted; });
    if (!ranking.seen_in_other_columns) compare_with_contained(candidates);
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return a.evidence > b.evidence; });
    return ranking;
}

}  // namespace ringlock::closure
