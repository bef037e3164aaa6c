#pragma once
#include <optional>

#include "analysis/closure/turns/loop/choice.hpp"
#include "analysis/closure/turns/residual/views.hpp"

/// Residual tests as rivals of the library: structure that a test explains better than any effect does is something
/// that the library lacks.
namespace ringlock::closure {

/// Frequency of the effect in that fit [Hz], if it has one.
std::optional<double> frequency_hz_of(const TurnFit& fit, const effects::Effect& effect);

/// Whether a line [Hz] lies where anything that follows the phase makes one in a gyro whose phases come in step: at a
/// harmonic of their beat, modulo the dither's frequency, to the resolution of the record.
bool is_on_beat(const TurnFit& fit, double hz);

/// Whether the candidate is such a line.
bool is_line_on_beat(const TurnFit& fit, const Candidate& candidate);

/// The largest merit of a residual test that explains more than the chosen effect and all that are tied to it, the
/// noise fitted again with either. None: the library explains the record best.
std::optional<double> better_than_library(const TurnFit& fit, const Choice& choice);

/// Whether a second effect next to the chosen one, one of them of the coupling, makes up for the merit of a residual
/// test: two such effects may look like something else where each is considered alone. Pairs of rates are not allowed,
/// since they could follow nearly anything.
bool two_explain(const TurnProblem& problem, const Choice& choice, double merit_of_test);

/// Tests of the residual, and where structure lies if any fails: the failing regression that explains most with the
/// noise fitted again, or the failing test that is least probable by chance where no regression explains anything.
struct Verification {
    std::vector<ResidualTest> tests;
    std::optional<ResidualTest> unexplained;
};
Verification verify(const TurnFit& fit);

}  // namespace ringlock::closure
