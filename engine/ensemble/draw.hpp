#pragma once
#include <cstdint>

#include "engine/gyro/setup.hpp"
#include "engine/random/stream.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::ensemble {

/// Gyros in a run: ensemble.gyros for each rate of the sweep. Gyro g is member g % gyros at rate g / gyros.
std::int64_t total_gyros(const scenario::Scenario& scenario);

/// Input rate of gyro g [deg/h]; that of a profile is its mean over the record.
double input_rate_deg_h(const scenario::Scenario& scenario, std::int64_t gyro);

/// Input rate of a gyro at a time since the start of the run [deg/h]: constant.
double input_rate_at_deg_h(const scenario::Scenario& scenario, const gyro::Setup& setup, double time_s);

/// Identity of gyro g in the random streams: the same member at another rate draws the same numbers, so that rates are
/// compared in pairs like arms.
random::Identity identity(const scenario::Scenario& scenario, std::int64_t gyro);

/// Identity of gyro g in the streams from which its constants are drawn: one for all its turn-ons.
random::Identity device_identity(const scenario::Scenario& scenario, std::int64_t gyro);

/// Draws the parameters of gyro g and lets the scenario's effects change them. Depends on the scenario and g only.
gyro::Setup draw_setup(const scenario::Scenario& scenario, std::int64_t gyro);

/// The device of the scenario without any spread.
gyro::Setup nominal_setup(const scenario::Scenario& scenario);

}  // namespace ringlock::ensemble
