#pragma once
#include <optional>
#include <vector>

#include "analysis/closure/samples/screen/screen.hpp"

/// The parts of screen_samples(), and their common functions.
namespace ringlock::closure {

/// A candidate of the first effect that acts on samples in this way; the other effects of that kind make the same
/// model. No value if the library has no such effect.
std::optional<SampleCandidate> candidate_of(OnSamples as);

/// Adds the effects that act in this way to those that make the same model as the candidate.
void confound(SampleCandidate& candidate, OnSamples as);

/// Lines in the input rate and in the output angle (screen_lines.cpp).
void screen_lines(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out);

/// Readings taken at another rate than that of the record (screen_source.cpp).
void screen_source(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out);

}  // namespace ringlock::closure
