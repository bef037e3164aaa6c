#pragma once
#include <optional>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/stats/normality.hpp"

/// Steps of the rate, and their times in the record.
namespace ringlock::closure {

/// The column of a step effect: a rate of one from that row on. Steps are searched at whole rows. The closed form of
/// the effect is not used, since rounding may let it begin a row early.
SampleColumn step_column(const effects::Effect& effect, const SampleSeries& series, std::size_t row);
bool is_step(const SampleColumn& column);
std::size_t row_of_step(const SampleColumn& step);

/// Square root of the chi-squared that a step at that row explains, with the sign of the step.
double root_of_step(const SampleFit& fit, std::size_t row);

/// The largest jump in the innovations of a model with a random rate, which decays soon after a step; else no value.
std::optional<Jump> jump_with_random_rate(const SampleFit& fit);

/// Row of the step that explains most near that row: within `reach` rows, by repeated halving. The model has no step.
std::size_t refine_place(const SampleFit& without, std::size_t row, std::size_t reach);

/// The same for the steps of a model, which is fitted again with them.
SampleFit refine_steps(SampleFit fit, const Rows& rows);

/// Places a step that lies between rows that count, which do not determine its time: there alone the rows in `known`
/// are used as well.
SampleFit place_in_gaps(SampleFit fit, const Rows& rows, const Rows& known);

}  // namespace ringlock::closure
