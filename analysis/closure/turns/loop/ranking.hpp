#pragma once
#include <cstddef>
#include <vector>

#include "analysis/closure/turns/fit/fitted.hpp"
#include "analysis/closure/turns/screen/score_tests.hpp"

/// The effects of the library that a record of turns supports, each in a full fit.
namespace ringlock::closure {

struct Ranking {
    std::vector<Candidate> candidates;   ///< fitted, by decreasing evidence
    bool seen_in_other_columns = false;  ///< in times, accelerations, radii or counts, and not in the phases
};

enum class Among { all, not_random };

/// Tests the library against the residual of a model and fits the most likely candidates in full.
/// \param most     largest number of candidates, without random rates
/// \param matters  evidence far below which accuracy does not matter [nats]
Ranking rank_candidates(const TurnProblem& problem, const Fitted& now, std::size_t most, Among among = Among::all,
                        double matters = 0.0);

/// Whether the effect contains one of the candidates (decide/effect_queries.hpp).
bool contains_one_of(const effects::Effect& effect, const std::vector<Candidate>& candidates);

}  // namespace ringlock::closure
