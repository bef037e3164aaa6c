#pragma once
#include <optional>

#include "analysis/closure/turns/loop/choice.hpp"
#include "analysis/closure/turns/residual/residual_tests.hpp"

/// Residual tests that compete with the library: structure that a test explains better than any effect has a cause that
/// is not in the library.
namespace ringlock::closure {

/// Frequency of the effect in that fit [Hz], if it has one.
std::optional<double> frequency_hz_of(const TurnFit& fit, const effects::Effect& effect);

/// Whether a line [Hz] is at a harmonic of the beat of phases in step, modulo the dither's frequency, within the
/// resolution of the record. Anything that follows the phase makes lines there.
bool is_on_beat(const TurnFit& fit, double hz);

/// Whether the candidate is such a line.
bool is_line_on_beat(const TurnFit& fit, const Candidate& candidate);

/// The largest evidence of a residual test that explains more than the chosen effect and all effects tied to it, with
/// the noise fitted again for each. None if the library explains the record best.
std::optional<double> better_than_library(const TurnFit& fit, const Choice& choice);

/// Whether a second effect next to the chosen one, one of them of the coupling, reaches the evidence of a residual
/// test, since neither of two such effects may explain the record alone. Pairs of rates are not allowed, since they
/// could follow nearly any cause.
bool two_explain(const TurnProblem& problem, const Choice& choice, double evidence_of_test);

/// Tests of the residual, and the location of structure if any fails: the failing regression that explains most with
/// the noise fitted again, or the failing test with the smallest p-value if no regression explains anything.
struct Verification {
    std::vector<ResidualTest> tests;
    std::optional<ResidualTest> unexplained;
};
Verification verify(const TurnFit& fit);

}  // namespace ringlock::closure
