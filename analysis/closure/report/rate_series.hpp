#pragma once
#include <cstddef>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/record/record.hpp"

/// The measured rate over time and near a frequency, and the prediction of the model, for the figures of a report.
namespace ringlock::closure {

/// Mean rates over consecutive intervals of one length.
struct RateSeries {
    double interval_s = 0.0;
    std::vector<double> time_s;  ///< middles of the intervals, by the record's clock
    std::vector<double> rate_deg_h;
};

/// The rates of a record: of each sample, or between successive minima of the dither's phase in a record of turns.
RateSeries rates_of(const record::Record& record);

/// Means over groups of these rates, as large as needed for at most `points` means.
RateSeries averaged(const RateSeries& rates, std::size_t points);

/// The deterministic part of the model, as mean rates over the same intervals [deg/h]: mean rate or bias, known input,
/// and the effects that add an angle, without their random parts.
std::vector<double> determined_rates(const record::Record& record, const Closure& closure, const RateSeries& rates);

/// A spectrum near one frequency, finer than the resolution of the record.
struct NearLine {
    std::vector<double> hz;
    std::vector<double> amplitude_deg_h;  ///< amplitude of a line at that frequency with the same power
    double resolution_hz = 0.0;           ///< one over the length of the record
};
/// \param hz  frequency as the record shows it, up to half of the rate of the series
NearLine spectrum_near(const RateSeries& rates, double hz);

}  // namespace ringlock::closure
