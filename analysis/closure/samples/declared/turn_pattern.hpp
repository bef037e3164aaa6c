#pragma once
#include <memory>
#include <optional>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// Kicks of the lock-in in a record of samples. They arrive at the turns of the dither, so that the white rate noise of
/// a sample is proportional to the number of turns in it.
struct TurnPattern {
    double turn_hz = 0.0;  ///< turns per second, two per cycle of the dither
    double place = 0.0;    ///< turns since the last one at the record's start, in [0, 1)
    double late_s = 0.0;   ///< rms of the times of the turns about a uniform sequence, by a noisy drive
    double share = 0.0;    ///< share of the white rate's variance that arrives in kicks
    double gain = 0.0;     ///< of the log-likelihood of the base model by the pattern
    std::shared_ptr<const KickRows> kicks;
};

/// Frequency of the turns, at whose alias the squares of innovations have a line, and the step of the spectrum that
/// shows it.
struct SeenTurns {
    double turn_hz = 0.0;
    double bin_hz = 0.0;
};
/// Searches near the declared dither, which there must be; no value where the line may be chance.
std::optional<SeenTurns> turns_in_squares(const SampleFit& base, const record::Declared& declared);

/// Searches for the turns of the declared dither by the squares of the innovations of the base model; no value where
/// the record declares no dither, or where its samples do not show the turns.
///
/// A kick is not instantaneous: it takes the time in which the phase turns, the root of pi over the phase acceleration.
/// With the time from a turn to the end of a row in that unit, the share of the kick up to there is a Fresnel integral.
std::optional<TurnPattern> find_turn_pattern(const SampleFit& base, const record::Declared& declared);

/// Adds the pattern to the noise of the model.
void take_turn_pattern(const TurnPattern& pattern, SampleNoise& noise);
/// Removes the kicks at the turns and the noise of the dither from the noise, or replaces them by those of another
/// noise.
void drop_turn_pattern(SampleNoise& noise);
void copy_turn_pattern(const SampleNoise& from, SampleNoise& to);

/// Excess kurtosis of sums of `length` innovations that the base model predicts. Two of its noises are not normal: a
/// kick follows the arcsine law, of excess -3/2, and the error of a count is uniform, of excess -6/5.
double expected_excess(const SampleFit& fit, std::size_t length);

}  // namespace ringlock::closure
