#pragma once
#include <memory>
#include <optional>
#include <string>

#include "analysis/closure/turn_contest.hpp"

namespace ringlock::closure {

/// A model in which the dither's amplitude swings at one frequency more.
struct Swinging {
    std::shared_ptr<Fitted> fitted;
    double merit = 0.0;  ///< gain of the log-likelihood, as that of an effect
};

/// What of the innovations comes at frequencies so near the dither's that no vibration of the base could be told from
/// the dither's own motion (amplitude_band_hz): none if that may be chance.
std::optional<Swinging> find_amplitude_swing(const record::Record& record, const Fitted& now, const Rows& rows);

/// What the report says of it.
std::string note_on(const AmplitudeSwing& swing, const TurnSeries& series);

}  // namespace ringlock::closure
