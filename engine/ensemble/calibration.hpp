#pragma once
#include <span>

#include "engine/compensate/lane_compensator.hpp"
#include "engine/gyro/device.hpp"
#include "engine/readout/electronics.hpp"
#include "engine/scenario/scenario.hpp"

/// The electronics of a scenario and the calibration of its compensators.
namespace ringlock::ensemble {

readout::Electronics electronics_of(const scenario::Scenario& scenario);

/// The coupling of the threshold that calibration gives for the device.
double calibrated_b_rad_s(const scenario::Scenario& scenario, const gyro::Device& device);

/// Calibration of a block of gyros, with injected noise or without.
compensate::Calibration calibration_of(const scenario::Scenario& scenario, std::span<const gyro::Device> devices,
                                       bool noise_injected);

}  // namespace ringlock::ensemble
