#include "analysis/closure/turns/loop/candidate_fit.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/turns/model/effect_roles.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

double cost_of_own_amplitudes(double gain, const effects::Effect& effect) {
    return cost_of_amplitudes(gain, count_of(effect, {effects::Role::size, effects::Role::phase}));
}

}  // namespace

double predicted_evidence(const Candidate& candidate) {
    const double gain = 0.5 * candidate.chi2;
    const int positions = count_of(*candidate.effect, {effects::Role::time, effects::Role::frequency});
    return gain - std::log(candidate.look_elsewhere) - positions - cost_of_own_amplitudes(gain, *candidate.effect);
}

double evidence_of(double gain, const Fitted& fitted, const effects::Effect& effect) {
    double evidence = gain - cost_of_own_amplitudes(gain, effect);
    if (count_of(effect, {effects::Role::time, effects::Role::frequency}) == 0) return evidence;
    for (const Estimate& estimate : fitted.fit->estimates()) {
        if (estimate.effect != effect.name()) continue;
        for (const effects::Parameter& parameter : effect.parameters()) {
            if (parameter.name != estimate.name) continue;
            const double range = parameter.role == effects::Role::time        ? fitted.series().time_s.back()
                                 : parameter.role == effects::Role::frequency ? 0.5 / fitted.series().interval_s
                                                                              : 0.0;
            if (range > 0.0) evidence -= std::max(0.0, std::log(range / (std::sqrt(units::two_pi) * estimate.sd)));
        }
    }
    return evidence;
}

double p_of_fit(const Fitted& fitted, const Fitted& without, const Candidate& candidate) {
    using effects::Role;
    const double chi2 = 2.0 * std::max(0.0, gain_over(fitted, without));
    const int amplitudes = count_of(*candidate.effect, {Role::size, Role::phase, Role::deviation, Role::probability});
    // Times and frequencies were searched. The look-elsewhere factor grows as the root of the maximum.
    const double higher = std::sqrt(std::max(1.0, chi2 / std::max(candidate.chi2, 1e-300)));
    return of_several(chi2_tail(chi2, amplitudes),
                      candidate.look_elsewhere > 1.0 ? candidate.look_elsewhere * higher : 1.0);
}

CandidateFit::CandidateFit(const TurnProblem& problem, const Fitted& now, const Candidate& candidate)
    : problem_(problem),
      now_(now),
      candidate_(candidate),
      start_(now.parameters()),
      strong_rate_(candidate.effect->adds_angle() && candidate.chi2 > options.turns.loop.strong_chi2) {
    start_.effects.push_back({candidate.effect, candidate.values});
}

void CandidateFit::begin(const Fitted* alike, double needed) {
    const TurnOptions::Loop& limits = options.turns.loop;
    needed_ = now_.log_likelihood() + needed;
    const effects::Effect& effect = *candidate_.effect;
    // Coupling, threshold and bias move together: from a small share the first step moves all of them.
    if (is_of_coupling(effect)) from(with_share(limits.small_share));
    if (!is_of_coupling(effect) || !gained_most()) from(start_);
    // The fit without the effect may have biased the other parameters strongly.
    if (is_random_rate(effect) || changes_reading(effect) ||
        (strong_rate_ && !gained(limits.little_of_chi2 * candidate_.chi2))) {
        anew(alike);
    }
    // The score's estimate is linear: if it lies too far away, shorter steps are tried.
    const int shorter = estimated_from_other_columns(effect) ? 0 : limits.shorter_starts;
    double share = 1.0;
    for (int k = 0; k < shorter && !gained(0.0); ++k) from(with_share(share *= 0.1));
}

bool CandidateFit::gained_most() const { return gained(options.turns.loop.nearly_all_of_chi2 * candidate_.chi2); }

void CandidateFit::begin_as(const effects::Effect& smaller, const Fitted& fitted, double needed) {
    needed_ = now_.log_likelihood() + needed;
    TurnParameters start = fitted.parameters();
    ActiveEffect& active = *start.find(&smaller);
    active = {candidate_.effect, values_as_larger(*candidate_.effect, smaller, active.values)};
    from(start);
    if (gained_most()) {
        anew_ = true;
    } else {
        begin(nullptr, needed);
    }
}

void CandidateFit::again_if_strong() {
    if (strong_rate_ && !anew_) anew(nullptr);
}

void CandidateFit::from(const TurnParameters& start) {
    if (best_) best_->fit->release();
    auto fitted = problem_.fit_or_none(start, needed_);
    if (!fitted) return;
    if (!best_ || fitted->log_likelihood() > best_->log_likelihood()) best_ = std::move(fitted);
}

void CandidateFit::anew(const Fitted* alike) {
    anew_ = true;
    TurnParameters parameters = alike != nullptr ? alike->parameters() : TurnParameters{};
    parameters.effects = start_.effects;
    parameters.swings = start_.swings;
    parameters.wander_forgets = start_.wander_forgets;
    from(parameters);
}

TurnParameters CandidateFit::with_share(double share) const {
    // Some effects have a phase only.
    const bool has_size = effects::first_of(*candidate_.effect, effects::Role::size) != nullptr;
    TurnParameters parameters = start_;
    for (const effects::Parameter& parameter : candidate_.effect->parameters()) {
        if (parameter.role == (has_size ? effects::Role::size : effects::Role::phase)) {
            parameters.effects.back().values.at(std::string(parameter.name)) *= share;
        }
    }
    return parameters;
}

}  // namespace ringlock::closure
