#pragma once
#include <optional>

#include "engine/gyro/setup.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::ensemble {

/// Whether a gyro of the scenario without injected noise sees the same drive in every cycle: no active effect adds a
/// rate that varies in time, noise included, and none changes the coupling in time; amplitude and input rate stay,
/// too.
bool drive_repeats(const scenario::Scenario& scenario);

/// Mean output rate less input rate [deg/h] of a gyro whose drive repeats itself, without injected noise or correction:
/// the rotation number of its cycle, over infinite time. Takes some 0.1 ms. None where the dither has too few fringes
/// for the map to be formed.
std::optional<double> closed_form_rate_error_deg_h(const gyro::Setup& setup);

}  // namespace ringlock::ensemble
