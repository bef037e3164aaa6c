#pragma once
#include "analysis/closure/turns/model/series.hpp"
#include "analysis/closure/types.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// Probability that the counter misses a quarter fringe in the half cycle before a turn.
struct MissedShare {
    double probability_per_turn = 0.0;
    double sd = 0.0;
};

/// By maximum likelihood of the chain of lost quarters (CountChain).
MissedShare share_of_missed_counts(const record::Turns& turns, const JoinedPhase& joined, const Rows& rows);

}  // namespace ringlock::closure
