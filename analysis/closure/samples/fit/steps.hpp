#pragma once
#include <optional>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/stats/normality.hpp"

/// Steps of the rate, and where in the record they are.
namespace ringlock::closure {

/// The column of an effect that steps: a rate of one from that row on. Steps are searched at whole rows, so that this
/// is not the closed form of the effect, which rounding lets begin a row early.
SampleColumn step_column(const effects::Effect& effect, const SampleSeries& series, std::size_t row);
bool is_step(const SampleColumn& column);
std::size_t row_of_step(const SampleColumn& step);

/// What a step at that row explains, its sign that of the step.
double root_of_step(const SampleFit& fit, std::size_t row);

/// The largest of the innovations' own, where the model has a random rate, beside which a step is forgotten soon.
std::optional<Jump> jump_beside_random(const SampleFit& fit);

/// The row near that one at which a step explains most: within so many rows, by halves of that. The model has no step.
std::size_t refine_place(const SampleFit& without, std::size_t row, std::size_t reach);

/// The same for the steps of a model, which is fitted anew with them.
SampleFit refine_steps(SampleFit fit, const Rows& rows);

/// Where a step lies between rows that count, these do not say where: there alone the rows that are known besides do.
SampleFit place_in_gaps(SampleFit fit, const Rows& rows, const Rows& known);

}  // namespace ringlock::closure
