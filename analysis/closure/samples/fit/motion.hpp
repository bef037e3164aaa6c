#pragma once
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// What a motion in proportion to a witness adds to the increments, and the same a quarter of a cycle later.
std::vector<std::vector<double>> motion_columns(const std::vector<double>& witness);
void add_motion(SampleModel& model, const SampleSeries& series, const effects::Effect& effect, std::size_t witness,
                int step);
SampleModel without_motion(SampleModel model);
/// The model with all that a witness tells of a motion, lag by lag, and what it does not tell as two resonances.
SampleModel moved_as(const SampleFit& now, const effects::Effect& effect, std::size_t witness, int step);

/// Whether the effect, null for the base model, is a motion of the case.
bool is_motion(const effects::Effect* effect);

}  // namespace ringlock::closure
