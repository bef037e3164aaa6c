#pragma once
#include <cstdint>

#include "engine/scenario/scenario.hpp"

/// Studies whose arms are read by readers (`reader.output_hz`), and the consequences for their outputs and times.
namespace ringlock::scenario {

/// Whether the arms of a study are read by readers; otherwise their angles are taken at the minima of the dither.
bool reads_arms(const Scenario& scenario);

/// Angles a second of every arm that the statistics of a study are made of [Hz]: the readers' outputs, or one a dither
/// cycle.
double outputs_hz(const Scenario& scenario);

/// The readers of a study; zeros where its arms are not read.
struct StudyReader {
    double latch_hz = 0.0;             ///< rate of the ticks
    double delay_s = 0.0;              ///< by which outputs lag behind a steady rotation
    std::int64_t warm_up_outputs = 0;  ///< that are not fit for use, and before the record
};
StudyReader study_reader(const Scenario& scenario);

/// Amplitude of a steady dither that the readers of a study leave over that of the dither; 0 without readers.
double reader_residue_relative(const Scenario& scenario);

/// Simulated time of each gyro [s]: settling, warm-up of the readers, and the record.
double simulated_s(const Scenario& scenario);

/// Samples that noise coefficients are fitted to are no closer than that [s]. A reader that averages takes the noise of
/// short intervals away: at ten times the length of a filter of linear phase, which is twice its delay, it takes a
/// thirtieth of the variance of an increment and a sixtieth of N at most. Kicks come once a half cycle, and closer
/// samples than a dither cycle would see them one by one. Without readers samples need no distance: 0.
double least_fit_interval_s(const Scenario& scenario);

}  // namespace ringlock::scenario
