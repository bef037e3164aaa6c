#pragma once
#include <memory>
#include <optional>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// Injected noise of the dither, in readings from which the dither is not removed, or only its line: it varies over a
/// half cycle, and readings in the same half cycle share it.
struct DitherNoise {
    double turn_hz = 0.0;     ///< turns per second, two per cycle of the dither
    double place = 0.0;       ///< turns since the last one at the record's start, in [0, 1)
    double share = 0.0;       ///< of the variance of the readings' errors
    double memory = 0.0;      ///< correlation of the amplitudes from turn to turn
    double asymmetry = 0.0;   ///< delay of the turn in the middle of a cycle, in turns
    DitherFollower follower;  ///< mean that a notch has learnt of the amplitudes, or delay of a resonator's turns
    double larger = 1.0;      ///< white angle noise, of which it is a share, relative to that of the fit before
    double gain = 0.0;        ///< of the log-likelihood of the base model
    std::shared_ptr<const DitherRows> rows;
    /// Instead of all these, for a noisy drive: its turns are late as well, so that the noise is the same at any phase
    /// of the dither, and its half cycles carry no information.
    SampleNoise::Resonance sidebands = {0.0, 0.0, 0.0};
};

/// Searches for it in a record whose declared reader leaves it; no value where another reader is declared, or where it
/// is not significant.
std::optional<DitherNoise> find_dither_noise(const SampleFit& base, const record::Record& record);

/// Adds it to the noise of the model, as the start of a fit.
void take_dither_noise(const DitherNoise& found, SampleNoise& noise);

}  // namespace ringlock::closure
