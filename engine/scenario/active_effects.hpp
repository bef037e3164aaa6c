#pragma once
#include <string>
#include <vector>

#include "engine/effects/effect.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/scenario/scenario.hpp"

/// The effects that a scenario turns on. Code that needs their effect on a gyro evaluates them from here, not by their
/// names.
namespace ringlock::scenario {

/// Draws further out than this from their mean are treated as impossible by rules and bounds, in standard deviations.
inline constexpr double sigmas = 6.0;

/// An effect that does something, and its values; both belong to others, the values to the scenario.
struct ActiveEffect {
    const effects::Effect* effect;
    const effects::Values* values;
};

/// The effects of the registry that do something in the scenario, in the order of their names.
std::vector<ActiveEffect> active_effects(const Scenario& scenario);

/// Keys of the effect's parameters in a scenario's file.
std::vector<std::string> keys_of(const effects::Effect& effect);

/// The gyro of the scenario as its effects configure it, without spread and without an input rate.
gyro::Setup configured_setup(const Scenario& scenario);

/// Smallest and largest input rate [deg/h]: of all points of the sweep, or of the profile.
struct InputRange {
    double lowest_deg_h;
    double highest_deg_h;
};
InputRange input_range(const InputRate& input);

/// Steepest slope of the input's profile [deg/h each second]; 0 without one.
double input_slope_deg_h_s(const InputRate& input);

/// The most that a gyro is exposed to over the run, the time before the record included.
effects::Exposure exposure(const Scenario& scenario);

/// How far an active effect can take the gyros of a run.
struct EffectBounds {
    const effects::Effect* effect;
    effects::Bounds certain;
    double rate_sd_deg_h;  ///< standard deviation of its random rate, averaged over the shortest half cycle
};
std::vector<EffectBounds> bounds_of_effects(const Scenario& scenario);

/// Bound of the change of the lock-in threshold by all effects together, over the threshold.
double threshold_change_relative(const Scenario& scenario);

}  // namespace ringlock::scenario
