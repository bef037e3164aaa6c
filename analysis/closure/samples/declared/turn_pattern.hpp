#pragma once
#include <memory>
#include <optional>
#include <vector>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// The kicks of the lock-in, as a record of samples has them: they arrive at the turns of the dither, so that the white
/// rate noise of a sample goes with the number of turns in it.
struct TurnPattern {
    double turn_hz = 0.0;  ///< turns a second, two a cycle of the dither
    double place = 0.0;    ///< turns passed at the record's start since the last one, in [0, 1)
    double late_s = 0.0;   ///< rms of the times of the turns about a uniform sequence, as a noisy drive has them
    double share = 0.0;    ///< of the white rate's variance, that comes in kicks
    double gain = 0.0;     ///< of the log-likelihood of the base model by the pattern
    std::shared_ptr<const KickRows> kicks;
};

/// Turns a second at whose alias the squares of innovations have a line, and the step of the spectrum that shows it.
struct SeenTurns {
    double turn_hz = 0.0;
    double bin_hz = 0.0;
};
/// Near the declared dither, which there must be; none where the line may be chance.
std::optional<SeenTurns> turns_in_squares(const SampleFit& base, const record::Declared& declared);

/// Finds the turns of the declared dither by the squares of the innovations of the base model; none where the record
/// declares no dither, or where its samples do not show the turns.
///
/// A kick is no instant: it comes as the phase turns, in a time of the root of pi over the phase acceleration. With the
/// time from a turn to the end of a row in that unit, the share of the kick up to there is a Fresnel integral.
std::optional<TurnPattern> find_turn_pattern(const SampleFit& base, const record::Declared& declared);

/// The model's noise with the pattern.
void take_turn_pattern(const TurnPattern& pattern, SampleNoise& noise);
/// The noise without kicks at the turns and without noise of the dither, and with those of another.
void drop_turn_pattern(SampleNoise& noise);
void copy_turn_pattern(const SampleNoise& from, SampleNoise& to);

/// Excess kurtosis of sums of `length` innovations that the base model predicts. Two of its noises are not normal: a
/// kick follows the arcsine law, of excess -3/2, and the error of a count is uniform, of excess -6/5.
double expected_excess(const SampleFit& fit, std::size_t length);

}  // namespace ringlock::closure
