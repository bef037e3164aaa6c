#pragma once
#include <memory>
#include <optional>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// Noise of the dither, as injected, in readings of which the dither is not taken off, or only its line: it varies over
/// a half cycle, and readings in the same half cycle have it in common.
struct DitherNoise {
    double turn_hz = 0.0;     ///< turns a second, two a cycle of the dither
    double place = 0.0;       ///< turns passed at the record's start since the last one, in [0, 1)
    double share = 0.0;       ///< of the variance of the readings' errors
    double memory = 0.0;      ///< correlation of the amplitudes from turn to turn
    double asymmetry = 0.0;   ///< the turn in the middle of a cycle is late by it, in turns
    DitherFollower follower;  ///< what a notch has learnt of the amplitudes, or by what a resonator's turns are late
    double larger = 1.0;      ///< white angle noise, of which it is a share, over that of the fit before
    double gain = 0.0;        ///< of the log-likelihood of the base model
    std::shared_ptr<const DitherRows> rows;
    /// Instead of all that, of a noisy drive: its turns are late as well, so that the noise is the same at any phase of
    /// the dither, and its half cycles say nothing.
    SampleNoise::Resonance sidebands = {0.0, 0.0, 0.0};
};

/// Finds it in a record whose declared reader leaves it; none where another reader is declared, or where it does not
/// show.
std::optional<DitherNoise> find_dither_noise(const SampleFit& base, const record::Record& record);

/// The model's noise with it, from where a fit may begin.
void take_dither_noise(const DitherNoise& found, SampleNoise& noise);

}  // namespace ringlock::closure
