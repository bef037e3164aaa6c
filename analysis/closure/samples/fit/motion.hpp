#pragma once
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// Increments of a motion that is proportional to a witness, and of the same motion a quarter of a cycle later.
std::vector<std::vector<double>> motion_columns(const std::vector<double>& witness);
void add_motion(SampleModel& model, const SampleSeries& series, const effects::Effect& effect, std::size_t witness,
                int step);
SampleModel without_motion(SampleModel model);
/// The model with the motion that a witness predicts, lag by lag, and two resonances for the part that it does not
/// predict.
SampleModel moved_as(const SampleFit& now, const effects::Effect& effect, std::size_t witness, int step);

/// Whether the effect, null for the base model, is a motion of the case.
bool is_motion(const effects::Effect* effect);

}  // namespace ringlock::closure
