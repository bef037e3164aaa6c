#pragma once
#include <string>
#include <vector>

#include "analysis/closure/sample_fit.hpp"

namespace ringlock::closure {

/// A line whose frequency drifts evenly.
struct FoundLine {
    double frequency_hz = 0.0;  ///< in the middle of the rows
    double drift_hz_per_s = 0.0;
    double chi2 = 0.0;        ///< of its two amplitudes, the frequency as found
    double chi2_still = 0.0;  ///< largest without drift, near by
    double p_value = 1.0;     ///< its search counted
    double searched = 1.0;
    double scattered = 0.0;  ///< power over the level in pieces, chi-squared above what chance leaves there
    double scattered_hz = 0.0;
    bool coherent = true;  ///< it keeps its phase over the rows
};

/// The line that stands out most from the spectrum about it. `values` are zero where they do not count. Lines within
/// `width_hz` of those in `known` are passed over.
FoundLine find_line(const std::vector<double>& values, double rate_hz, bool drifting,
                    const std::vector<double>& known_hz = {}, double width_hz = 0.0);

/// The angle 2 pi (f t + d t^2/2) of a line at each sample, t from the middle.
std::vector<double> line_phase(std::size_t size, double rate_hz, double frequency_hz, double drift_hz_per_s);

/// Variance, or the covariance of neighbours, that repeats: a line in the products of innovations.
struct FoundCycle {
    double frequency_hz = 0.0;
    double p_value = 1.0;
    double searched = 1.0;
};
FoundCycle find_cycle(const std::vector<double>& innovations, const Rows& rows, double rate_hz);

/// Correlation with a witness at all lags up to a few tenths of a second.
struct FoundWitness {
    std::string name;
    std::size_t index = 0;  ///< in the series
    double chi2 = 0.0;
    int lags = 0;
    double p_value = 1.0;
};
FoundWitness find_witness(const std::vector<double>& innovations, const Rows& rows, const SampleSeries& series);

/// Response of the increments to the witness, lag by lag, fitted in the rows that count, and the motion by it.
struct WitnessMotion {
    std::vector<double> increments;
    double coherence = 0.0;   ///< magnitude-squared, where most of the motion is
    double rms_arcsec = 0.0;  ///< of the motion's angle that the witness tells
    double centre_hz = 0.0;   ///< where most of it is
};
WitnessMotion fit_witness(const SampleFit& fit, const std::vector<double>& witness);

/// Lags that a witness is held against, on either side.
int witness_lags(double rate_hz);

/// In blocks: fast Fourier transform of real values, zeros behind.
std::vector<double> periodogram(const std::vector<double>& values, std::size_t padded);

}  // namespace ringlock::closure
