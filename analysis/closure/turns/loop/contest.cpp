#include "analysis/closure/turns/loop/contest.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/turns/screen/side_channels.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Effects that change the phases as they are read.
bool on_phase(const effects::Effect& effect) {
    return effect.name() == "readout_ellipse" || effect.name() == "missed_counts";
}

double cost_of_own_amplitudes(double gain, const effects::Effect& effect) {
    return cost_of_amplitudes(gain, count_of(effect, {effects::Role::size, effects::Role::phase}));
}

/// What a score promises, by the search that it took.
double promise_of(const Candidate& candidate) {
    const double gain = 0.5 * candidate.chi2;
    const int places = count_of(*candidate.effect, {effects::Role::time, effects::Role::frequency});
    return gain - std::log(candidate.searched) - places - cost_of_own_amplitudes(gain, *candidate.effect);
}

/// The gain with the amplitudes integrated out, and times and frequencies, which may be anywhere (Laplace): so has the
/// likelihood of a random rate its course.
double merit_of(double gain, const Fitted& fitted, const effects::Effect& effect) {
    double merit = gain - cost_of_own_amplitudes(gain, effect);
    if (count_of(effect, {effects::Role::time, effects::Role::frequency}) == 0) return merit;
    for (const Estimate& estimate : fitted.fit->estimates()) {
        if (estimate.effect != effect.name()) continue;
        for (const effects::Parameter& parameter : effect.parameters()) {
            if (parameter.name != estimate.name) continue;
            const double range = parameter.role == effects::Role::time        ? fitted.series.time_s.back()
                                 : parameter.role == effects::Role::frequency ? 0.5 / fitted.series.interval_s
                                                                              : 0.0;
            if (range > 0.0) merit -= std::max(0.0, std::log(range / (std::sqrt(units::two_pi) * estimate.sd)));
        }
    }
    return merit;
}

/// Scores are of the noise as it is, which may have swallowed what an effect does, or without what of it hardly shows:
/// they only say where to look.
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

/// Those worth a full fit, the likeliest first; random rates beside so many others.
std::vector<Candidate> worth_a_fit(std::vector<Candidate> candidates, double largest_p, std::size_t most) {
    std::erase_if(candidates, [&](const Candidate& c) { return !(c.p_value < largest_p); });
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return promise_of(a) > promise_of(b); });
    std::size_t taken = 0;
    std::erase_if(candidates, [&](const Candidate& c) { return !is_random_rate(*c.effect) && ++taken > most; });
    return candidates;
}

/// Fits of the model with one effect more, all parameters anew, from several places; the likeliest counts.
class Fits {
   public:
    Fits(const record::Record& record, const Fitted& now, const Candidate& candidate, const Rows& rows)
        : record_(record),
          now_(now),
          candidate_(candidate),
          rows_(rows),
          start_(now.fit->parameters()),
          strong_rate_(candidate.effect->adds_angle() && candidate.chi2 > strong) {
        start_.effects.push_back({candidate.effect, candidate.values});
    }

    /// From what the score says. `alike` is a model that has another random rate in its place, where there is one.
    /// Less than `needed` of gain need not be told exactly.
    void begin(const Fitted* alike, double needed) {
        needed_ = now_.fit->log_likelihood() + needed;
        // Coupling, threshold and bias move together: from next to nothing the first step takes all of them along.
        const effects::Effect& effect = *candidate_.effect;
        if (is_of_coupling(effect)) from(with_share(0.01));
        if (!is_of_coupling(effect) || !gained(nearly_all * candidate_.chi2)) from(start_);
        // Without it the rest may have gone far astray.
        if (is_random_rate(effect) || on_phase(effect) || (strong_rate_ && !gained(0.25 * candidate_.chi2))) {
            anew(alike);
        }
        // The score says how large it would be were all linear: too far away, maybe.
        const int shorter = told_by_other_columns(effect) ? 0 : 4;
        double share = 1.0;
        for (int k = 0; k < shorter && !gained(0.0); ++k) from(with_share(share *= 0.1));
    }

    /// What is strong may have led the rest astray without having to come back for most of its gain.
    void again_if_strong() {
        if (strong_rate_ && !anew_) anew(nullptr);
    }

    /// None where no motion of a gyro with such parameters can be followed.
    const std::shared_ptr<Fitted>& best() const { return best_; }

   private:
    void from(const TurnParameters& start) {
        auto fitted = fit_or_none(record_, start, rows_, needed_);
        if (!fitted) return;
        if (!best_ || fitted->fit->log_likelihood() > best_->fit->log_likelihood()) best_ = std::move(fitted);
    }
    void anew(const Fitted* alike) {
        anew_ = true;
        TurnParameters parameters = alike != nullptr ? alike->fit->parameters() : TurnParameters{};
        parameters.effects = start_.effects;
        parameters.swings = start_.swings;
        parameters.wander_forgets = start_.wander_forgets;
        from(parameters);
    }
    TurnParameters with_share(double share) const {
        // Some effects are a phase and nothing else.
        const bool has_size = effects::first_of(*candidate_.effect, effects::Role::size) != nullptr;
        TurnParameters parameters = start_;
        for (const effects::Parameter& parameter : candidate_.effect->parameters()) {
            if (parameter.role == (has_size ? effects::Role::size : effects::Role::phase)) {
                parameters.effects.back().values.at(std::string(parameter.name)) *= share;
            }
        }
        return parameters;
    }
    bool gained(double least) const {
        return best_ && best_->fit->log_likelihood() - now_.fit->log_likelihood() >= least;
    }

    static constexpr double strong = 400.0;  // chi-squared
    // Half of it is what the score says: a fit that ends with much less may lie in a valley beside it.
    static constexpr double nearly_all = 0.45;

    const record::Record& record_;
    const Fitted& now_;
    const Candidate& candidate_;
    const Rows& rows_;
    TurnParameters start_;
    bool strong_rate_;
    double needed_ = 0.0;  ///< of the log-likelihood
    bool anew_ = false;
    std::shared_ptr<Fitted> best_;
};

double gain_of(const Fitted& fitted, const Fitted& without) {
    return fitted.fit->log_likelihood() - without.fit->log_likelihood();
}

double p_of(const Fitted& fitted, const Fitted& without, const Candidate& candidate) {
    // Times and frequencies are what was searched. A search is worth more the higher it goes, as the root of it.
    using effects::Role;
    const double chi2 = 2.0 * std::max(0.0, gain_of(fitted, without));
    const int amplitudes = count_of(*candidate.effect, {Role::size, Role::phase, Role::deviation, Role::probability});
    const double higher = std::sqrt(std::max(1.0, chi2 / std::max(candidate.chi2, 1e-300)));
    return of_several(chi2_tail(chi2, amplitudes), candidate.searched > 1.0 ? candidate.searched * higher : 1.0);
}

}  // namespace

Contest hold_contest(const record::Record& record, const Fitted& now, const Rows& rows, std::size_t most, Among among,
                     double matters) {
    constexpr double worth_looking = 0.1;
    constexpr double much = 200.0;  // beside which fits that come nowhere near it are not gone on with
    Contest contest;
    auto candidates =
        worth_a_fit(screen_side_channels(*record.turns, *now.fit, now.joined), level_of_one_effect(), most);
    contest.side = !candidates.empty();
    if (contest.side) {
        // What changes the phases that were read stands alone.
        const bool alone = on_phase(*candidates.front().effect);
        for (std::size_t k = candidates.size(); k-- > 1;) {
            if (alone || on_phase(*candidates[k].effect)) {
                candidates.erase(candidates.begin() + static_cast<std::ptrdiff_t>(k));
            }
        }
    } else {
        candidates = screen_by_any_noise(*now.fit);
        if (among == Among::not_random) {
            std::erase_if(candidates, [](const Candidate& c) { return is_random_rate(*c.effect); });
        }
        candidates = worth_a_fit(std::move(candidates), worth_looking, most);
    }
    std::vector<Fits> fits;
    std::vector<Contender> contenders(candidates.size());
    std::vector<std::size_t> random;
    for (std::size_t k = 0; k < candidates.size(); ++k) {
        if (is_random_rate(*candidates[k].effect)) random.push_back(k);
        fits.emplace_back(record, now, candidates[k], rows);
    }
    const auto judge = [&](std::size_t k) {
        const Candidate& candidate = candidates[k];
        Contender& contender = contenders[k];
        contender.fitted = fits[k].best();
        if (!contender.fitted) return;
        contender.merit = contest.side
                              ? promise_of(candidate)
                              : merit_of(gain_of(*contender.fitted, now), *contender.fitted, *candidate.effect);
        contender.p_value = contest.side ? candidate.p_value : p_of(*contender.fitted, now, candidate);
    };
    constexpr double nearly = 0.9;  // of the most that any explains
    constexpr double far = 0.5;
    const auto needed = [&] { return matters > much ? far * matters : -std::numeric_limits<double>::infinity(); };
    const auto fit_together = [&](const std::vector<std::size_t>& some, const Fitted* alike) {
        const double least = needed();
        oneapi::tbb::parallel_for(std::size_t{0}, some.size(), [&](std::size_t i) {
            fits[some[i]].begin(is_random_rate(*candidates[some[i]].effect) ? alike : nullptr, least);
            judge(some[i]);
        });
        for (const std::size_t k : some) {
            if (contenders[k].fitted) matters = std::max(matters, contenders[k].merit);
        }
    };
    // The likeliest goes before the others, and so does the likeliest random rate.
    std::vector<std::size_t> first;
    std::vector<std::size_t> others;
    for (std::size_t k = 0; k < candidates.size(); ++k) {
        const bool leads = k == 0 || (!random.empty() && k == random.front());
        (leads ? first : others).push_back(k);
    }
    fit_together(first, nullptr);
    fit_together(others, random.empty() ? nullptr : contenders[random.front()].fitted.get());
    oneapi::tbb::parallel_for(std::size_t{0}, contenders.size(), [&](std::size_t k) {
        if (!contenders[k].fitted || contenders[k].merit < nearly * matters) return;
        fits[k].again_if_strong();
        judge(k);
    });
    for (std::size_t k = 0; k < contenders.size(); ++k) contenders[k].candidate = std::move(candidates[k]);
    std::erase_if(contenders, [](const Contender& contender) { return !contender.fitted; });
    std::sort(contenders.begin(), contenders.end(),
              [](const Contender& a, const Contender& b) { return a.merit > b.merit; });
    contest.contenders = std::move(contenders);
    return contest;
}

namespace {

/// What may explain a record: an effect, or one with others that are added next.
struct Account {
    const Contender* first = nullptr;
    std::vector<Candidate> others = {};
    std::shared_ptr<Fitted> fitted = {};
    double merit = 0.0;
    double p_value = 1.0;  ///< of the first, beside the others

    bool has(const effects::Effect* effect) const {
        return first->candidate.effect == effect ||
               std::any_of(others.begin(), others.end(), [&](const Candidate& c) { return c.effect == effect; });
    }
    bool has_all_of(const Account& other) const {
        return has(other.first->candidate.effect) &&
               std::all_of(other.others.begin(), other.others.end(), [&](const Candidate& c) { return has(c.effect); });
    }
    long random_rates() const {
        return std::count_if(others.begin(), others.end(),
                             [](const Candidate& c) { return is_random_rate(*c.effect); }) +
               (is_random_rate(*first->candidate.effect) ? 1 : 0);
    }
};

/// The likeliest of either kind with what explains most beside it, and random rates by twos; each needed beside the
/// other.
std::vector<Account> pairs(const record::Record& record, const std::vector<Contender>& contenders, const Rows& rows) {
    constexpr std::size_t tried_first = 3;
    constexpr std::size_t tried_second = 2;
    std::vector<Account> accounts;
    const auto add = [&](const Contender& first, const std::shared_ptr<Fitted>& both, const Candidate& second) {
        const auto alone = std::find_if(contenders.begin(), contenders.end(),
                                        [&](const Contender& c) { return c.candidate.effect == second.effect; });
        double p_value = first.p_value;
        if (alone != contenders.end()) p_value = p_of(*both, *alone->fitted, first.candidate);
        if (!passes(p_value) || !passes(p_of(*both, *first.fitted, second))) return;
        const double merit = merit_of(gain_of(*both, *first.fitted), *both, *second.effect);
        accounts.push_back({&first, {second}, both, first.merit + merit - cost_of_choice(), p_value});
    };
    std::vector<const Contender*> firsts;
    std::vector<const Contender*> random;
    std::size_t tried = 0;
    for (const Contender& contender : contenders) {
        const bool is_random = is_random_rate(*contender.candidate.effect);
        if (is_random ? !passes(contender.p_value) : ++tried > tried_first) continue;
        firsts.push_back(&contender);
        if (is_random) random.push_back(&contender);
    }
    struct Pair {
        const Contender* first;
        const Contender* second;
        std::shared_ptr<Fitted> both = {};
    };
    std::vector<Pair> of_random;
    for (std::size_t a = 0; a < random.size(); ++a) {
        for (std::size_t b = a + 1; b < random.size(); ++b) of_random.push_back({random[a], random[b]});
    }
    std::vector<Contest> beside(firsts.size());
    oneapi::tbb::parallel_for(std::size_t{0}, firsts.size() + of_random.size(), [&](std::size_t k) {
        if (k < firsts.size()) {
            beside[k] = hold_contest(record, *firsts[k]->fitted, rows, tried_second, Among::not_random,
                                     contenders.front().merit - firsts[k]->merit);
            return;
        }
        Pair& pair = of_random[k - firsts.size()];
        TurnParameters start = pair.first->fitted->fit->parameters();
        start.effects.push_back(*pair.second->fitted->fit->parameters().find(pair.second->candidate.effect->name()));
        pair.both = fit_or_none(record, start, rows);
    });
    for (std::size_t k = 0; k < firsts.size(); ++k) {
        for (const Contender& other : beside[k].contenders) {
            if (!beside[k].side) add(*firsts[k], other.fitted, other.candidate);
        }
    }
    for (const Pair& pair : of_random) {
        if (pair.both) add(*pair.first, pair.both, pair.second->candidate);
    }
    return accounts;
}

/// The likeliest pairs that random rates have not followed alone, with a third: so random a rate can also follow three
/// others at once, and beside another random one hide what jumps. Those that do as well as the best account, each
/// effect needed beside the others. `accounts` are sorted.
std::vector<Account> triples(const record::Record& record, const std::vector<Account>& accounts, const Rows& rows) {
    constexpr std::size_t tried_third = 2;
    constexpr double most_of_it = 0.75;  // without which one more hardly makes up for the rest
    const double best = accounts.front().merit;
    std::vector<const Account*> extended;
    for (const long random : {0L, 1L}) {
        const auto likeliest = std::find_if(accounts.begin(), accounts.end(), [&](const Account& account) {
            return account.others.size() == 1 && account.random_rates() == random;
        });
        if (likeliest == accounts.end()) continue;
        // Beside one random rate what a pair leaves is found when that has been added, but for what another one hides.
        const bool may_win = random == 0 ? likeliest->merit > most_of_it * best : !accounts.front().others.empty();
        if (may_win) extended.push_back(&*likeliest);
    }
    std::vector<std::vector<Account>> found(extended.size());
    oneapi::tbb::parallel_for(std::size_t{0}, extended.size(), [&](std::size_t k) {
        const Account& pair = *extended[k];
        const Contest contest = hold_contest(record, *pair.fitted, rows, tried_third, Among::all, best - pair.merit);
        if (contest.side) return;
        for (const Contender& third : contest.contenders) {
            const double merit = pair.merit + third.merit - cost_of_choice();
            if (!(merit > best - options.tie) || !passes(third.p_value)) continue;
            const auto p_beside = [&](const Candidate& candidate) {
                TurnParameters without = third.fitted->fit->parameters();
                std::erase_if(without.effects,
                              [&](const ActiveEffect& active) { return active.effect == candidate.effect; });
                const auto fitted = fit_or_none(record, without, rows);
                return fitted ? p_of(*third.fitted, *fitted, candidate) : 1.0;
            };
            const double p_value = p_beside(pair.first->candidate);
            if (!passes(p_value) || !passes(p_beside(pair.others.front()))) continue;
            found[k].push_back({pair.first, {pair.others.front(), third.candidate}, third.fitted, merit, p_value});
        }
    });
    std::vector<Account> all;
    for (std::vector<Account>& some : found) {
        for (Account& account : some) {
            const bool known =
                std::any_of(all.begin(), all.end(), [&](const Account& other) { return other.has_all_of(account); });
            if (!known) all.push_back(std::move(account));
        }
    }
    return all;
}

}  // namespace

Choice choose(const record::Record& record, const Contest& contest, const Rows& rows) {
    Choice choice;
    const auto& contenders = contest.contenders;
    if (contenders.empty() || !passes(contenders.front().p_value)) return choice;
    std::vector<Account> accounts;
    for (const Contender& contender : contenders) {
        accounts.push_back({&contender, {}, contender.fitted, contender.merit, contender.p_value});
    }
    const auto sort = [&] {
        std::stable_sort(accounts.begin(), accounts.end(),
                         [](const Account& a, const Account& b) { return a.merit > b.merit; });
    };
    if (!contest.side && is_random_rate(*contenders.front().candidate.effect)) {
        for (Account& pair : pairs(record, contenders, rows)) accounts.push_back(std::move(pair));
        sort();
        for (Account& triple : triples(record, accounts, rows)) {
            accounts.push_back(std::move(triple));
        }
    }
    sort();
    const Account best = accounts.front();
    std::erase_if(accounts, [&](const Account& a) { return !(a.merit > best.merit - options.tie); });

    // Of several, what more of those as likely have in them.
    choice.chosen = best.first;
    choice.p_value = best.p_value;
    const auto in_how_many = [&](const effects::Effect* effect) {
        return std::count_if(accounts.begin(), accounts.end(), [&](const Account& a) { return a.has(effect); });
    };
    for (const Candidate& candidate : best.others) {
        if (in_how_many(candidate.effect) <= in_how_many(choice.chosen->candidate.effect)) continue;
        const auto other = std::find_if(contenders.begin(), contenders.end(), [&](const Contender& c) {
            return c.candidate.effect == candidate.effect && passes(c.p_value);
        });
        if (other == contenders.end()) continue;
        choice.chosen = &*other;
        choice.p_value = other->p_value;
    }
    const effects::Effect* chosen = choice.chosen->candidate.effect;
    choice.held.push_back({chosen, best.merit});
    choice.on_random = best.random_rates() > 0;
    const auto partner = [&](const effects::Effect* effect) {
        if (effect != chosen) choice.partners.emplace_back(effect->name());
    };
    partner(best.first->candidate.effect);
    for (const Candidate& candidate : best.others) partner(candidate.effect);
    for (const Account& account : accounts) {
        if (account.has(chosen)) continue;
        const auto tied = [&](const effects::Effect* effect) {
            if (best.has(effect)) return;
            const auto known = std::find_if(choice.held.begin(), choice.held.end(),
                                            [&](const Held& held) { return held.effect == effect; });
            if (known != choice.held.end()) return;
            choice.held.push_back({effect, account.merit});
            choice.confounded_with.emplace_back(effect->name());
        };
        tied(account.first->candidate.effect);
        for (const Candidate& candidate : account.others) tied(candidate.effect);
    }
    if (!best.others.empty() || !chosen->adds_angle() || is_random_rate(*chosen)) return choice;
    for (const Contender& contender : contenders) {
        const std::string name(contender.candidate.effect->name());
        auto& tied = choice.confounded_with;
        if (!is_random_rate(*contender.candidate.effect) || std::find(tied.begin(), tied.end(), name) != tied.end()) {
            continue;
        }
        if (contender.merit > std::max(0.0, best.merit - options.tie_with_random)) tied.push_back(name);
    }
    return choice;
}

}  // namespace ringlock::closure
