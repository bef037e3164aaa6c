#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ringlock::allan {

/// Kind of a series of numbers. The caller must state it: the same numbers give another deviation for each kind.
enum class Kind {
    phase,      ///< accumulated angle (or time error) at each instant
    increment,  ///< gain of the phase over each interval
    rate        ///< mean rate (or fractional frequency) over each interval
};

/// Points [begin, end) of a phase between which nothing is missing.
struct Stretch {
    std::size_t begin = 0;
    std::size_t end = 0;
    std::size_t size() const { return end - begin; }
};

/// Phase with a straight line removed, ready for the estimators of allan.hpp.
struct Phase {
    std::vector<double> x;  ///< at uniform instants; NaN where it is not known. Begins and ends with a known value
    double line_per_sample = 0.0;    ///< slope of the line that was taken away; time interval errors put it back
    std::vector<Stretch> stretches;  ///< the parts without gaps, ascending; at least one where x is not empty
    /// Whether phase is counted from one origin in all stretches. A missing increment or rate loses the origin: the
    /// change of the phase meanwhile is not known, so that no difference may reach across.
    bool one_origin = true;

    bool whole() const { return stretches.size() <= 1; }  ///< no gaps
};

/// Phase of a record that may have gaps.
///
/// \param data    samples in time order, tau0_s apart; NaN where one is missing, else finite
/// \param kind    kind of the data
/// \param tau0_s  sampling interval [s]; > 0
/// \param scale   unit of the data: multiplied in last, when all digits that matter are small
/// \return phase in the unit `scale` makes (times seconds for rates): one point a sample for phase, one more than
///         samples for increments and rates, that sequence beginning with 0; missing samples at either end are left out
///
/// Allan and Hadamard deviations are blind to a line, so the line through the two ends (phase) or the mean (increments,
/// rates) is taken out before anything is summed. A counter that runs at 10 MHz keeps its digits: differences are
/// formed with their rounding error and the line with one fused rounding, the running sum is compensated.
Phase phase_of(std::span<const double> data, Kind kind, double tau0_s, double scale = 1.0);

/// The same of whole counts, which may wrap around: a line of whole slope is taken away in whole numbers, so that the
/// phase is exact (before `scale`) as long as it stays within 2^53 counts of the line.
///
/// \param counts   samples; those that are missing may hold anything
/// \param present  values of the same samples of which only NaN is looked at; empty where none is missing
Phase phase_of(std::span<const std::int64_t> counts, std::span<const double> present, Kind kind, double tau0_s,
               double scale);

/// The points of phase_of() for data without gaps.
std::vector<double> centred_phase(std::span<const double> data, Kind kind, double tau0_s);

}  // namespace ringlock::allan
