#pragma once
#include <complex>
#include <cstddef>
#include <vector>

#include "analysis/closure/samples/model/frequency_track.hpp"

/// Search for lines in a series of white innovations, with the probability of the largest one by chance.
namespace ringlock::closure {

/// A line of constant or evenly drifting frequency.
struct FoundLine {
    double frequency_hz = 0.0;  ///< in the middle of the rows
    double drift_hz_per_s = 0.0;
    double chi2 = 0.0;            ///< of its two amplitudes, at this frequency and drift
    double p_value = 1.0;         ///< with the look-elsewhere correction of its search
    double look_elsewhere = 1.0;  ///< look-elsewhere factor of this search at that chi2
    double squares = 0.0;         ///< its part of the sum of the values' squares
};

/// Three searches for lines: of constant frequency; with a drift of a few cycles over the record, the phase followed
/// throughout; and with any drift, by power along straight tracks over pieces.
struct FoundLines {
    FoundLine still, slow, tracked;
    double scattered = 0.0;  ///< power in pieces above the level, chi-squared less its expectation in noise
    double scattered_hz = 0.0, scattered_drift_hz_per_s = 0.0;
    double scattered_squares = 0.0;  ///< that power as a part of the sum of the values' squares

    /// The line of the smallest p-value, corrected for the choice from three.
    FoundLine likeliest() const;
};

/// Values are zero where they do not count. Lines within `width_hz` of those in `known_hz` are excluded.
FoundLines find_lines(const std::vector<double>& values, double rate_hz, const std::vector<double>& known_hz = {},
                      double width_hz = 0.0);

/// The same for lines of constant frequency only.
FoundLine find_still_line(const std::vector<double>& values, double rate_hz, const std::vector<double>& known_hz = {},
                          double width_hz = 0.0);

/// A line on a curved frequency track whose phase is followed over the whole record. The search starts from the power
/// that stands out in pieces: first with the phases within pieces alone, then with fewer and longer pieces.
struct FoundTrack {
    FrequencyTrack track;
    double chi2 = 0.0;  ///< of its two amplitudes
};
/// Look-elsewhere factor of a search over curved tracks: that of a line with a drift of up to the limit of the tracks,
/// times, for each further coefficient, that of half a cycle per piece.
double look_elsewhere_of_track(double chi2, double cycles, std::size_t coefficients);
FoundTrack follow_bends(const std::vector<double>& values, double rate_hz, const FoundLines& found);

/// A narrow band about an expected line.
struct LineBand {
    double centre_hz = 0.0, half_width_hz = 0.0;
    double most_drift_hz_per_s = 0.0;  ///< of either sign
};
struct NarrowLines {
    FoundLine still, drifting;
};
NarrowLines find_lines_in(const std::vector<double>& values, double rate_hz, const LineBand& band,
                          const std::vector<double>& known_hz = {}, double width_hz = 0.0);

/// Look-elsewhere factor of a search over frequencies and drifts, at that chi-squared of two amplitudes. `cycles` is
/// the range of frequencies times the record's length, `drift_cycles` that of drifts times the square of the length,
/// both signs together. Euler characteristic of a chi-squared field above that level (Worsley, Adv. Appl. Prob. 26,
/// 1994, 13).
double look_elsewhere_of_drift(double chi2, double cycles, double drift_cycles);

/// Squared magnitudes of the Fourier transform of real values, padded with zeros, below half the rate.
std::vector<double> periodogram(const std::vector<double>& values, std::size_t padded);
std::vector<std::complex<double>> transform(const std::vector<std::complex<double>>& in, bool back = false);
std::size_t power_of_two(std::size_t least);

}  // namespace ringlock::closure
