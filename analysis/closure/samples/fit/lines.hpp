#pragma once
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"

/// Lines in samples; frequency and drift are fitted together with their amplitudes.
namespace ringlock::closure {

/// a cos + b sin of 2 pi times the cycles of the frequency track.
struct SampleLine {
    FrequencyTrack track;
    double chi2 = 0.0;  ///< explained by its two amplitudes
};

/// Derivatives of a line with amplitudes a and b, by its frequency and by each free drift, as the record contains it.
std::vector<std::vector<double>> line_slopes(const SampleFit& fit, const FrequencyTrack& track, double a, double b);

/// Sets the two columns of a line, of which `cosine` is the first, to another frequency track.
void set_line(SampleModel& model, std::size_t cosine, const SampleSeries& series, const FrequencyTrack& track);

/// Fits a line by Gauss and Newton from its place in the innovations, in the rows that count, next to a model without
/// this line. In a resampled record every frequency of the source that appears there is tried.
SampleLine refine_line(const SampleFit& fit, const FrequencyTrack& shown);

/// Whether the power that stands out in pieces of the innovations belongs to a line without constant phase: it remains
/// when the line of constant phase that explains most is removed. The innovations are zero in rows that do not count.
bool scatters(const SampleFit& fit, std::vector<double> innovations, const FoundLines& found, const SampleLine& line);

/// The model with that power as a narrow resonance, whose amplitude and phase vary.
/// \param effect  owner of the resonance; null for a model that only tests the residual
SampleModel with_wandering_line(const SampleFit& fit, const FoundLines& found, const Rows& rows,
                                const effects::Effect* effect, int step);

/// Refines all lines of a model as refine_line() does, and fits the model again with them.
SampleFit refine_lines(SampleFit fit, const Rows& rows);

}  // namespace ringlock::closure
