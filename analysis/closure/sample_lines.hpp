#pragma once
#include <vector>

#include "analysis/closure/sample_fit.hpp"

/// Lines in samples, their frequency and drift fitted as closely as their amplitudes are.
namespace ringlock::closure {

/// a cos + b sin of 2 pi (f t + d t^2/2), t from the middle of the record.
struct SampleLine {
    double hz = 0.0, drift_hz_per_s = 0.0;
    bool drifts = false;
    double chi2 = 0.0;  ///< that its two amplitudes explain
};

std::vector<std::vector<double>> line_columns(std::size_t size, double rate_hz, double hz, double drift_hz_per_s);

/// What a change of the frequency and, where it drifts, of the drift adds to a line of those amplitudes.
std::vector<std::vector<double>> line_slopes(std::size_t size, double rate_hz, const SampleLine& line, double a,
                                             double b);

/// By Gauss and Newton from a first estimate, in the rows that count, beside a model that does not have the line.
SampleLine refine_line(const SampleFit& fit, SampleLine line);

/// The same for all lines of a model, which is fitted anew with them.
SampleFit refine_lines(const SampleSeries& series, SampleFit fit, const Rows& rows);

}  // namespace ringlock::closure
