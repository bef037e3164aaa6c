#pragma once
#include <span>

#include "engine/compensate/lane_compensator.hpp"
#include "engine/gyro/device.hpp"
#include "engine/readout/electronics.hpp"
#include "engine/scenario/scenario.hpp"

/// What electronics and compensators of a scenario are, and are told about its gyros.
namespace ringlock::ensemble {

readout::Electronics electronics_of(const scenario::Scenario& scenario);

/// The threshold as measured.
double told_b_rad_s(const scenario::Scenario& scenario, const gyro::Device& device);

/// Of a block of gyros, under injected noise of that rms.
compensate::Calibration calibration_of(const scenario::Scenario& scenario, std::span<const gyro::Device> devices,
                                       double noise_rms_rad);

}  // namespace ringlock::ensemble
