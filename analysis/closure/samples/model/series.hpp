#pragma once
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/types.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// A record of uniform samples as the loop wants it: increments, and what may go with them.
struct SampleSeries {
    double rate_hz = 0.0;
    double interval_s = 0.0;
    std::vector<double> time_s;                                          ///< at the end of each increment
    std::vector<double> increment;                                       ///< [arcsec]
    Rows missing;                                                        ///< 1 where the record has a gap, which was
                                                                         ///< filled; empty where it has none
    std::vector<std::pair<std::string, std::vector<double>>> witnesses;  ///< accelerations that change
    std::vector<double> temperature_change_k;                            ///< since the start; empty where there is none
    std::vector<double> temperature_slope_k_per_s;                       ///< of that; empty where there is none
    double temperature_start_sd_k = 0.0;                                 ///< by the thermometer's noise
    std::vector<double> input_rate_deg_h;                                ///< empty where there is none
    double input_late_s = 0.0;         ///< by which the known input's clock was found to be early
    bool counted = false;              ///< by kind whole counts
    double scale_factor_arcsec = 0.0;  ///< of counts
    bool scale_factor_assumed = false;
    bool dither_left = false;   ///< by a reader that is declared not to take it out, or its line alone
    bool whole_cycles = false;  ///< by a reader that is declared to count over whole cycles of the dither
    bool cycle_counts = false;  ///< and these counts have no fraction: values come in steps, interpolated ones apart
    double count_noise_arcsec = 0.0;  ///< rms of the uniform error of a reading, as the reader is declared

    std::size_t size() const { return increment.size(); }
};

/// Throws InputError where the record has too few samples, none that change or too many that are missing. Samples that
/// are missing are filled in and marked.
SampleSeries prepare_samples(const record::Record& record);

/// Steps that values come in.
struct Lattice {
    double printed_arcsec = 0.0;  ///< all values are whole multiples of it; 0: of none
    double step_arcsec = 0.0;     ///< coarser one below, blurred by that; else the same
    double strength = 0.0;        ///< of the coarser: length of the mean of exp(2 pi i value/step) over values not zero
    double p_value = 1.0;
    double step_sd_arcsec = 0.0;  ///< standard error of the step
};
/// \param sd_arcsec  of what one increment does not tell of the next: rates that the record dwells at are no steps
Lattice find_lattice(const std::vector<double>& increments, double sd_arcsec);

}  // namespace ringlock::closure
