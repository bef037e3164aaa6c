#pragma once
#include <optional>
#include <vector>

#include "analysis/closure/samples/screen/screen.hpp"

/// The parts of screen_samples(), and what they share.
namespace ringlock::closure {

/// A candidate of the first effect that shows in this way; the others of that kind make the same model. None where the
/// library has no such effect.
std::optional<SampleCandidate> candidate_of(OnSamples as);

/// Notes that effects which show in this way make the candidate's model as well.
void confound(SampleCandidate& candidate, OnSamples as);

/// Lines in the input rate and in the output (screen_lines.cpp).
void screen_lines(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out);

/// Readings taken at another rate than that of the record (screen_source.cpp).
void screen_source(const SampleFit& now, const SampleContext& in, std::vector<SampleCandidate>& out);

}  // namespace ringlock::closure
