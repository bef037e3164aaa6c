#pragma once
#include <string>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"

namespace ringlock::closure {

/// A variance, or a covariance of adjacent rows, that repeats: a line in the products of innovations.
struct FoundCycle {
    double frequency_hz = 0.0;
    double p_value = 1.0;
    double look_elsewhere = 1.0;
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

/// Response of the increments to the witness, lag by lag, fitted in the rows that count, and the motion that it
/// predicts.
struct WitnessMotion {
    std::vector<double> increments;
    double coherence = 0.0;   ///< magnitude-squared, at the frequency with most of the motion
    double rms_arcsec = 0.0;  ///< of the predicted motion's angle
    double centre_hz = 0.0;   ///< frequency with most of the motion
};
WitnessMotion fit_witness(const SampleFit& fit, const std::vector<double>& witness);

/// Number of lags of a witness on either side.
int witness_lags(double rate_hz);

}  // namespace ringlock::closure
