#pragma once
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"

/// Lines in samples, their frequency and drift fitted as closely as their amplitudes are.
namespace ringlock::closure {

/// a cos + b sin of 2 pi times the turns of the course.
struct SampleLine {
    LineCourse course;
    double chi2 = 0.0;  ///< that its two amplitudes explain
};

/// What a change of the frequency, and of each drift that is free, adds to a line of those amplitudes, as the record
/// has it.
std::vector<std::vector<double>> line_slopes(const SampleFit& fit, const LineCourse& course, double a, double b);

/// The columns of a line, of which the cosine's is that one.
void set_line(SampleModel& model, std::size_t cosine, const SampleSeries& series, const LineCourse& course);

/// By Gauss and Newton from where a line shows in the innovations, in the rows that count, beside a model that does not
/// have the line. Of a resampled record, what its source has there.
SampleLine refine_line(const SampleFit& fit, const LineCourse& shown);

/// Whether the power that stands out in pieces of the innovations is that of a line which does not keep its phase: it
/// is still there when the line that explains most has been taken off. The innovations are zero where they do not
/// count.
bool scatters(const SampleFit& fit, std::vector<double> innovations, const FoundLines& found, const SampleLine& line);

/// The model with such power as a narrow resonance, which keeps neither amplitude nor phase.
/// \param effect  that the resonance belongs to; null for a model that only tests the residual
SampleModel with_wandering_line(const SampleFit& fit, const FoundLines& found, const Rows& rows,
                                const effects::Effect* effect, int step);

/// What refine_line() does for all lines of a model, which is fitted anew with them.
SampleFit refine_lines(SampleFit fit, const Rows& rows);

}  // namespace ringlock::closure
