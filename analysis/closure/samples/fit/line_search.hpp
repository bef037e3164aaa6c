#pragma once
#include <complex>
#include <cstddef>
#include <vector>

#include "analysis/closure/samples/model/line_course.hpp"

/// Lines in a series of white innovations: where one stands out, and how probable that is by chance.
namespace ringlock::closure {

/// A line whose frequency keeps or drifts evenly.
struct FoundLine {
    double frequency_hz = 0.0;  ///< in the middle of the rows
    double drift_hz_per_s = 0.0;
    double chi2 = 0.0;      ///< of its two amplitudes, frequency and drift as found
    double p_value = 1.0;   ///< its search counted
    double searched = 1.0;  ///< independent places that this search is worth at that chi2
    double squares = 0.0;   ///< what it is of the sum of the values' squares
};

/// By how much a line is found: as one that keeps its frequency; that drifts by a few cycles over the record, its phase
/// followed throughout; and by any drift, by power along straight tracks over pieces.
struct FoundLines {
    FoundLine still, slow, tracked;
    double scattered = 0.0;  ///< power over the level in pieces, chi-squared above what chance leaves there
    double scattered_hz = 0.0, scattered_drift_hz_per_s = 0.0;
    double scattered_squares = 0.0;  ///< of the sum of the values' squares, what that power is

    /// The least probable by chance, that being one of three counted.
    FoundLine likeliest() const;
};

/// Values are zero where they do not count. Lines within `width_hz` of those in `known` are passed over.
FoundLines find_lines(const std::vector<double>& values, double rate_hz, const std::vector<double>& known_hz = {},
                      double width_hz = 0.0);

/// The same for lines that keep their frequency only.
FoundLine find_still_line(const std::vector<double>& values, double rate_hz, const std::vector<double>& known_hz = {},
                          double width_hz = 0.0);

/// A line on a curve, its phase followed over the whole record, through the power that stands out in pieces: first the
/// phases within the pieces alone, then of ever fewer and longer ones.
struct FoundCourse {
    LineCourse course;
    double chi2 = 0.0;  ///< of its two amplitudes
};
/// How many independent places a search over such curves is worth: those of a line that drifts by as much as is
/// tracked, and for each coefficient more those of half a cycle a piece.
double places_of_bends(double chi2, double cycles, std::size_t coefficients);
FoundCourse follow_bends(const std::vector<double>& values, double rate_hz, const FoundLines& found);

/// A narrow band about where a line is expected.
struct LineBand {
    double centre_hz = 0.0, half_width_hz = 0.0;
    double most_drift_hz_per_s = 0.0;  ///< of either sign
};
struct NarrowLines {
    FoundLine still, drifting;
};
NarrowLines find_lines_in(const std::vector<double>& values, double rate_hz, const LineBand& band,
                          const std::vector<double>& known_hz = {}, double width_hz = 0.0);

/// How many independent places a search is worth at that chi-squared of two amplitudes, over frequencies and drifts,
/// these in cycles: drift times the square of the record's length, both signs together. The Euler characteristic of a
/// chi-squared field above that level (Worsley, Adv. Appl. Prob. 26, 1994, 13).
double places_of_drift(double chi2, double cycles, double drift_cycles);

/// Squared magnitudes of the Fourier transform of real values, zeros behind, below half the rate.
std::vector<double> periodogram(const std::vector<double>& values, std::size_t padded);
std::vector<std::complex<double>> transform(const std::vector<std::complex<double>>& in, bool back = false);
std::size_t power_of_two(std::size_t least);

}  // namespace ringlock::closure
