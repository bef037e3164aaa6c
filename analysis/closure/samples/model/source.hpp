#pragma once
#include <optional>
#include <vector>

#include "analysis/closure/samples/model/line_course.hpp"

/// What a resampled record has of an angle: its source took readings at a rate of its own, and the record has the
/// straight lines between them.
namespace ringlock::closure {

struct SampleSource {
    double from_hz = 0.0;     ///< 0: the record was not resampled, and has what there is
    double from_phase = 0.0;  ///< of the record's begin, between two of the source's readings; of their distance
};

/// A rate at which readings leave the same pattern in a record as readings at another rate do: a multiple of the
/// record's rate plus or minus that.
struct SamePattern {
    double hz = 0.0;
    double sign = 1.0;  ///< of the other rate in it, and of the place of the record's begin
};

/// That rate itself, and all of these rates that a record may be resampled from.
std::vector<SamePattern> with_same_pattern(double from_hz, double rate_hz);

/// Whether two rates of sources are one.
bool same_source(double one_hz, double other_hz, double rate_hz);

/// The place of the record's begin, where the source of another rate leaves the same pattern.
double phase_of(const SamePattern& pattern, double from_phase);

/// The source of a record that has more than five intervals to every two of its source: neighbours on one straight
/// line are the same, and where the angle turns between two lines says when its reading was taken. None where these are
/// not the times of a clock, or are few, as in a record that was not resampled or whose values are coarse.
std::optional<SampleSource> find_straight_lines(const std::vector<double>& increments, double rate_hz);

/// Increments of the record, of an angle that has these between the same times.
std::vector<double> as_taken(const SampleSource& source, const std::vector<double>& increments, double interval_s);

/// Increments of a line that are cos and sin of its course, from the middle of the record to the middle of each
/// interval.
std::vector<std::vector<double>> line_columns(std::size_t size, double rate_hz, const LineCourse& course);
/// The same as the record has it. The frequency is what the source's readings are of: up to half of its rate, which may
/// be more than half the record's. It is no multiple of the record's rate.
std::vector<std::vector<double>> line_as_taken(const SampleSource& source, std::size_t size, double rate_hz,
                                               const LineCourse& course);

/// Where a frequency shows in samples, and whether it goes down there as it goes up.
struct Alias {
    double hz = 0.0;
    bool folded = false;
};
Alias alias(double hz, double rate_hz);
/// In samples of that rate, of readings at `from_hz` where that is not zero.
Alias alias(double hz, double rate_hz, double from_hz);
/// What readings at `from_hz` have, at most half of it, and shows at that frequency in samples of them: the likeliest
/// first. Where there is no such rate, that frequency.
std::vector<Alias> of_source(double shown_hz, double rate_hz, double from_hz);

}  // namespace ringlock::closure
