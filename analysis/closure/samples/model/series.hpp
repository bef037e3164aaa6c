#pragma once
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/types.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// A record of uniform samples as the loop uses it: increments, and columns that may be related to them.
struct SampleSeries {
    double rate_hz = 0.0;
    double interval_s = 0.0;
    std::vector<double> time_s;     ///< at the end of each increment
    std::vector<double> increment;  ///< [arcsec]
    /// 1 where the record has a gap, which is filled; empty without gaps.
    Rows missing;
    /// Reference channels (accelerometers) that change.
    std::vector<std::pair<std::string, std::vector<double>>> witnesses;
    std::vector<double> temperature_change_k;  ///< since the start; empty if there is none
    /// Slope of the temperature; empty if there is none.
    std::vector<double> temperature_slope_k_per_s;
    /// Standard error of the temperature at the start, by the thermometer's noise.
    double temperature_start_sd_k = 0.0;
    std::vector<double> input_rate_deg_h;  ///< empty if there is none
    /// The known input fits the samples if it is read this much later than their time stamps imply.
    double input_late_s = 0.0;
    bool counted = false;              ///< samples are whole counts
    double scale_factor_arcsec = 0.0;  ///< of counts
    bool scale_factor_assumed = false;
    bool dither_left = false;   ///< the declared reader leaves the dither in the samples, or removes its line alone
    bool whole_cycles = false;  ///< the declared reader counts over whole cycles of the dither
    bool cycle_counts = false;  ///< these counts have no fraction: values come in steps, except for interpolated ones
    double count_noise_arcsec = 0.0;  ///< rms of the uniform error of a reading, by the declared reader

    std::size_t size() const { return increment.size(); }
};

/// Increments and columns of a record. Missing samples are filled and marked. Throws InputError if the record has too
/// few samples, if none of them changes, or if too many are missing.
SampleSeries prepare_samples(const record::Record& record);

/// Quantisation of the increments.
struct Lattice {
    double printed_arcsec = 0.0;  ///< all values are whole multiples of it; 0: no quantisation
    double step_arcsec = 0.0;     ///< larger step, which the printed digits blur; otherwise the same as printed_arcsec
    /// Of the larger step: length of the mean of exp(2 pi i value/step) over values that are not zero.
    double strength = 0.0;
    double p_value = 1.0;
    double step_sd_arcsec = 0.0;  ///< standard error of the step
};
/// \param sd_arcsec  standard deviation of the part of an increment that the increments before do not predict: a rate
///     at which the record stays for some time is not a step
Lattice find_lattice(const std::vector<double>& increments, double sd_arcsec);

}  // namespace ringlock::closure
