#pragma once
#include <vector>

#include "analysis/closure/decide/sets.hpp"
#include "analysis/closure/turns/loop/ranking.hpp"

/// Which of the ranked candidates is added to the model.
namespace ringlock::closure {

/// The candidate to add, if any.
struct Choice {
    const Candidate* chosen = nullptr;              ///< null: no candidate passes
    double p_value = 1.0;                           ///< of the chosen one, given its partners
    std::vector<Naming::Alternative> alternatives;  ///< the chosen effect and all that explain about as much
    bool on_random = false;                         ///< it is a random rate, or was chosen together with one
    std::vector<const effects::Effect*> confounded_with;
    std::vector<const effects::Effect*> partners = {};  ///< explain the rest, where several were chosen together
};

/// The likeliest candidate where it passes, with all that are as likely tied to it. A random rate can follow two or
/// three other effects at once: where one is the likeliest, sets of effects are tried before any is taken.
/// \param ranking  must outlive the choice
Choice choose(const TurnProblem& problem, const Ranking& ranking);

}  // namespace ringlock::closure
