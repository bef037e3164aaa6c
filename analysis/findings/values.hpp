#pragma once
#include <optional>
#include <span>
#include <vector>

#include "analysis/findings/finding.hpp"

namespace ringlock::findings {

/// Values that repeat for longer than chance allows at the step of the data, and values that pile up at either end of
/// their range. Missing values (NaN) end a run; runs of them are gaps, all of which are given, or where a record has
/// more than a hundred those that are longer than losses at random explain.
std::vector<Finding> search_values(std::span<const double> values);

/// A counter or an angle that starts again from the other end of its range.
struct Wraps {
    double modulus = 0.0;         ///< range of the counter, in the unit of the data
    std::vector<std::size_t> at;  ///< first datum behind each wrap
};

/// Wraps of the likeliest modulus: a power of two from 2^8 to 2^63, 360 deg, a turn in arcsec, mdeg or rad, or half of
/// these. Values must lie within the modulus, each wrap must go from near one end to near the other, and its step less
/// the modulus must be as small as the other steps. Nothing where there is none.
std::optional<Wraps> find_wraps(std::span<const double> values);

/// Wraps of a modulus that is known: at every step that exceeds the usual ones by more than half of it. Throws
/// InputError where the values are not within a range of that size.
Wraps wraps_of(double modulus, std::span<const double> values);

/// Takes the wraps off: values go on beyond the end of the range.
void unwrap(const Wraps& wraps, std::span<double> values);

}  // namespace ringlock::findings
