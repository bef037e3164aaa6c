#pragma once
#include <array>
#include <cstddef>
#include <vector>

#include "analysis/closure/options.hpp"

namespace ringlock::closure {

/// Frequency track of a line: a polynomial of the time from the middle of the record. A dither follows the temperature
/// of its springs: evenly over minutes, on a curve over an hour.
struct FrequencyTrack {
    static constexpr std::size_t most = options.samples.lines.most_coefficients;
    double hz = 0.0;  ///< in the middle of the record
    /// Derivatives of the frequency there, from the first on [Hz/s, Hz/s^2, ...].
    std::array<double, most - 1> drifts{};
    std::size_t free = 1;  ///< number of coefficients that are fitted; 1: constant frequency, 2: even drift

    double coefficient(std::size_t k) const { return k == 0 ? hz : drifts[k - 1]; }
    double& coefficient(std::size_t k) { return k == 0 ? hz : drifts[k - 1]; }
    /// Cycles since the middle of the record.
    double turns(double since_middle_s) const {
        double sum = 0.0;
        double power = 1.0;
        for (std::size_t k = 0; k < most; ++k) {
            power *= since_middle_s / static_cast<double>(k + 1);
            sum += coefficient(k) * power;
        }
        return sum;
    }
    double frequency_hz(double since_middle_s) const {
        double sum = 0.0;
        double power = 1.0;
        for (std::size_t k = 0; k < most; ++k) {
            sum += coefficient(k) * power;
            power *= since_middle_s / static_cast<double>(k + 1);
        }
        return sum;
    }
    /// Unit of coefficient k: the change that adds one cycle at either end of a record of that length.
    static double a_cycle(std::size_t k, double duration_s) {
        double unit = 1.0;
        for (std::size_t j = 0; j <= k; ++j) unit *= static_cast<double>(j + 1) / (0.5 * duration_s);
        return unit;
    }
    /// The same track at an alias, `other_hz` in the middle; the drifts change sign if `folded`.
    FrequencyTrack shown_at(double other_hz, bool folded) const {
        FrequencyTrack other = *this;
        other.hz = other_hz;
        if (folded) {
            for (double& drift : other.drifts) drift = -drift;
        }
        return other;
    }
    static FrequencyTrack still(double hz) { return {hz, {}, 1}; }
    static FrequencyTrack even(double hz, double drift_hz_per_s) { return {hz, {drift_hz_per_s}, 2}; }
};

/// Phase of a line at each sample [rad], without whole cycles, zero in the middle of the record.
std::vector<double> line_phase(std::size_t size, double rate_hz, const FrequencyTrack& track);

}  // namespace ringlock::closure
