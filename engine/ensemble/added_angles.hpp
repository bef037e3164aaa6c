#pragma once
#include <memory>
#include <vector>

#include "engine/effects/effect.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::ensemble {

/// What an effect adds to the angle of a block of gyros, chance apart, under the scenario's temperature and input rate.
/// The effect must outlive it.
std::unique_ptr<effects::LaneRateProcess> added_angles(const effects::Effect& effect, const effects::Values& values,
                                                       const scenario::Scenario& scenario,
                                                       const std::vector<gyro::Setup>& setups);

}  // namespace ringlock::ensemble
