#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// A mean with its standard error, which follows from the scatter of means over stretches of the record. It needs no
/// model of the noise of single turns, and is valid for coloured noise.
struct BlockMean {
    double value = 0.0;
    double sd = 0.0;
    std::vector<double> of_stretch;    ///< means over stretches of the whole record
    std::vector<std::uint8_t> counts;  ///< 1: all turns of the stretch count
};

/// The dither's shape as times and accelerations of the turns show it (docs/dev/closure-turns.md):
///   late    lateness of minima with respect to the middle between the maxima next to them, over four [s];
///   sides   acceleration of positive half cycles over that of negative ones, a quarter of the logarithm;
///   even    acceleration of all over that of a sine of that swing, the logarithm;
///   turns   acceleration at minima over that at maxima, a quarter of the logarithm of the product of both sides.
/// An asymmetry r gives late = r T/4, sides = r; a second harmonic of ratio r and phase f gives late = -r sin f/w,
/// turns = r cos f and, by two pulses at t1 and t2 after the turn, sides = -r sin f w (t1 + t2)/2.
struct DitherShape {
    BlockMean late_s;
    std::optional<BlockMean> sides, turns, even;  ///< none if the record has no accelerations
    double sides_by_sine = 0.0;                   ///< mean of w (t1 + t2)/2
    /// Factor of `sides` for an asymmetry: a rotation moves turns into one half cycle, and less of the other is
    /// measured.
    double sides_by_ratio = 1.0;
};
DitherShape dither_shape(const record::Turns& turns, const TurnFit& fit);

/// A note on accelerations that are neither those of a sine of the counted swing nor those of the effects in the model;
/// else empty. Kicks are proportional to one over the root of the acceleration, so that the relative change of the
/// threshold is half as large.
std::string note_on_acceleration(const record::Turns& turns, const TurnFit& fit);

}  // namespace ringlock::closure
