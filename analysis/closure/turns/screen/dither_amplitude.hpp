#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/closure/turns/fit/fitted.hpp"

namespace ringlock::closure {

/// A model of the dither's amplitude that knows more of it.
struct AmplitudeModel {
    std::shared_ptr<Fitted> fitted;
    double merit = 0.0;  ///< gain of the log-likelihood, as that of an effect
};

/// What of the innovations comes at frequencies so near the dither's that no vibration of the base could be told from
/// the dither's own motion (amplitude_band_hz): none if that may be chance.
std::optional<AmplitudeModel> find_amplitude_swing(const TurnProblem& problem, const Fitted& now);

/// Where innovations go with those before: whether a wander of the amplitude that is forgotten, as by a resonator of
/// low quality that noise drives, explains it.
std::optional<AmplitudeModel> find_amplitude_memory(const TurnProblem& problem, const Fitted& now);

/// What the report says of either.
std::vector<std::string> notes_on_amplitude(const Fitted& fitted);

}  // namespace ringlock::closure
