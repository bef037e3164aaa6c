#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/closure/turns/fit/fitted.hpp"

namespace ringlock::closure {

/// An extended model of the dither's amplitude.
struct AmplitudeModel {
    std::shared_ptr<Fitted> fitted;
    double evidence = 0.0;  ///< gain of the log-likelihood, with costs as for an effect
};

/// An oscillation of the amplitude for structure of the innovations so near the dither's frequency that a vibration of
/// the base there could not be distinguished from the dither's own motion (amplitude_band_hz). None if it may be
/// chance.
std::optional<AmplitudeModel> find_amplitude_swing(const TurnProblem& problem, const Fitted& now);

/// A wander of the amplitude that decays, as of a resonator of low quality that noise drives, for innovations that are
/// correlated with earlier ones. None if it does not explain them.
std::optional<AmplitudeModel> find_amplitude_memory(const TurnProblem& problem, const Fitted& now);

/// Notes for the report on both.
std::vector<std::string> notes_on_amplitude(const Fitted& fitted);

}  // namespace ringlock::closure
