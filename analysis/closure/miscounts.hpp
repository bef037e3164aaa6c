#pragma once
#include "analysis/closure/turn_fit.hpp"
#include "analysis/closure/turn_series.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// How often the counter misses a quarter fringe, in the half cycle before a turn.
struct MissedShare {
    double probability_per_turn = 0.0;
    double sd = 0.0;
};

/// By maximum likelihood of a hidden Markov chain: how many quarters are lost, modulo the four that the quadrature
/// tells apart, falls or rises by one at each turn with that probability, as the phase went (the method of Baum,
/// Petrie, Soules and Weiss, Annals of Mathematical Statistics 41, 1970, 164). A turn near the edge of a quarter says
/// of two neighbours only that it is one of them; changes of the difference between count and quadrature, counted one
/// by one, lose those that the next turn takes back.
MissedShare share_of_missed_counts(const record::Turns& turns, const JoinedPhase& joined, const Rows& rows);

}  // namespace ringlock::closure
