#pragma once
#include <cstddef>
#include <vector>

#include "analysis/closure/turns/fit/fitted.hpp"
#include "analysis/closure/turns/screen/score_tests.hpp"

/// The effects of the library that a record of turns supports, each fitted in full.
namespace ringlock::closure {

struct Ranking {
    std::vector<Candidate> candidates;   ///< fitted, by decreasing merit
    bool seen_in_other_columns = false;  ///< in times, accelerations, radii or counts, and not in the phases
};

enum class Among { all, not_random };

/// Screens the library against the residual of a model and fits the promising candidates in full.
/// \param most     so many at most, random rates not counted
/// \param matters  merit far below which a fit need not be exact [nats]
Ranking rank_candidates(const TurnProblem& problem, const Fitted& now, std::size_t most, Among among = Among::all,
                        double matters = 0.0);

/// Whether the effect does what one of the candidates does, and more (decide/effect_queries.hpp).
bool contains_one_of(const effects::Effect& effect, const std::vector<Candidate>& candidates);

}  // namespace ringlock::closure
