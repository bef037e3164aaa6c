#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// A figure with its standard error, from the scatter of its means over stretches of the record: whatever the noise of
/// single turns is, and whether it has a colour.
struct BlockMean {
    double value = 0.0;
    double sd = 0.0;
    std::vector<double> of_stretch;    ///< means over stretches, all of the record
    std::vector<std::uint8_t> counts;  ///< 1: the stretch is among the turns that count
};

/// What times and accelerations of the turns say of the dither's shape (docs/dev/closure-turns.md):
///   late    how late minima are against the middle between the maxima next to them, over four [s];
///   sides   acceleration of positive half cycles over that of negative ones, a quarter of the logarithm;
///   even    acceleration of all over that of a sine of that swing, the logarithm;
///   turns   acceleration at minima over that at maxima, a quarter of the logarithm of the product of both sides.
/// An asymmetry r makes late = r T/4, sides = r; a second harmonic of ratio r and phase f makes late = -r sin f/w,
/// turns = r cos f and, by two pulses at t1 and t2 after the turn, sides = -r sin f w (t1 + t2)/2.
struct DitherShape {
    BlockMean late_s;
    std::optional<BlockMean> sides, turns, even;  ///< none where the record has no accelerations
    double sides_by_sine = 0.0;                   ///< mean of w (t1 + t2)/2
    double sides_by_ratio = 1.0;  ///< where a rotation moves turns into one half cycle, less of the other is seen
};
DitherShape dither_shape(const record::Turns& turns, const TurnFit& fit);

/// What to say of accelerations that are not those of a sine of the counted swing, nor of the effects in the model;
/// else nothing. Kicks go with one over the root of the acceleration, so that the threshold is the larger by half as
/// much.
std::string note_on_acceleration(const record::Turns& turns, const TurnFit& fit);

}  // namespace ringlock::closure
