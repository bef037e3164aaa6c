#pragma once
#include <optional>
#include <vector>

#include "analysis/closure/samples/model/frequency_track.hpp"

/// Model of a resampled record: its source took readings of the angle at a rate of its own, and the record contains the
/// straight lines between them.
namespace ringlock::closure {

struct SampleSource {
    double from_hz = 0.0;  ///< rate of the source; 0: the record was not resampled
    /// Place of the record's start between two of the source's readings, as a share of their distance.
    double from_phase = 0.0;
};

/// Rate of a source that leaves the same pattern in a record as another rate: a multiple of the record's rate plus or
/// minus the other rate.
struct SamePattern {
    double hz = 0.0;
    double sign = 1.0;  ///< of the other rate in that sum, and of the place of the record's start
};

/// The rate itself, and all rates with the same pattern that a record may be resampled from (options.samples.screen).
std::vector<SamePattern> with_same_pattern(double from_hz, double rate_hz);

/// Whether two rates belong to one source, by options.samples.contest.same_source of the record's rate.
bool same_source(double one_hz, double other_hz, double rate_hz);

/// Place of the record's start between two readings of a source whose rate has the same pattern.
double phase_of(const SamePattern& pattern, double from_phase);

/// Source of a record that has more than five intervals to every two of its source. Adjacent increments on one straight
/// line are equal, and an interval between two lines gives the time of the reading at which they meet.
/// \return no value if these are not the times of a regular clock, or are few, as in a record that was not resampled or
///     whose values are coarse
std::optional<SampleSource> find_straight_lines(const std::vector<double>& increments, double rate_hz);

/// Increments of a record that the source makes of an angle with these increments between the same times.
std::vector<double> as_taken(const SampleSource& source, const std::vector<double>& increments, double interval_s);

/// Two columns of increments, cos and sin of the phase of a line, which is counted from the middle of the record to the
/// middle of each interval.
std::vector<std::vector<double>> line_columns(std::size_t size, double rate_hz, const FrequencyTrack& track);
/// The same columns in a resampled record. The frequency is that in the source's readings: up to half of the source's
/// rate, which may be more than half of the record's, and not a multiple of the record's rate.
std::vector<std::vector<double>> line_as_taken(const SampleSource& source, std::size_t size, double rate_hz,
                                               const FrequencyTrack& track);

/// Frequency at which a line appears in samples, and whether it falls there if the frequency of the line rises.
struct Alias {
    double hz = 0.0;
    bool folded = false;
};
Alias alias(double hz, double rate_hz);
/// The same in samples at `rate_hz` of readings at `from_hz`; without a source `from_hz` is zero.
Alias alias(double hz, double rate_hz, double from_hz);
/// Frequencies in readings at `from_hz`, up to half of it, that appear at `shown_hz` in samples of these readings, the
/// most likely (lowest) first. Without a source the frequency itself.
std::vector<Alias> of_source(double shown_hz, double rate_hz, double from_hz);

}  // namespace ringlock::closure
