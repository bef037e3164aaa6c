#pragma once
#include <vector>

#include "analysis/closure/decide/sets.hpp"
#include "analysis/closure/turns/loop/ranking.hpp"

/// Selects the ranked candidate that is added to the model.
namespace ringlock::closure {

/// The candidate to add, if any.
struct Choice {
    const Candidate* chosen = nullptr;              ///< null: no candidate passes
    double p_value = 1.0;                           ///< of the chosen one, given its partners
    std::vector<Naming::Alternative> alternatives;  ///< the chosen effect and all effects that explain about as much
    bool on_random = false;                         ///< it is a random rate, or was chosen in a set with one
    std::vector<const effects::Effect*> confounded_with;
    std::vector<const effects::Effect*> partners = {};  ///< the other effects of the set, if one was chosen
};

/// The most likely candidate if it passes, with all that are equally likely tied to it. A random rate can follow two or
/// three other effects at once: if one is the most likely candidate, sets of effects are tried first.
/// \param ranking  must outlive the choice
Choice choose(const TurnProblem& problem, const Ranking& ranking);

}  // namespace ringlock::closure
