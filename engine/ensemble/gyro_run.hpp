#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/gyro/setup.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::ensemble {

/// One gyro through all arms of a study.
struct GyroRecord {
    gyro::Setup setup;
    /// [arm][sample]: angle output of the gyro with the dither stripped [arcsec], sampled as Schedule says.
    std::vector<std::vector<double>> angle_arcsec;
    std::int64_t turns = 0;            ///< zero-rate points of the trajectories simulated, without that of `ideal`
    std::int64_t turns_off_table = 0;  ///< half cycles that the turn map solved outside its tables
    double turn_map_error_rad = 0.0;   ///< largest interpolation error measured when the tables were made; 0: no tables
};

/// What a simulation tells while it runs, and asks; both may be empty, and are called from any thread.
struct Monitor {
    std::function<bool()> cancelled;  ///< true stops the simulation with Interrupted
    std::function<void(std::int64_t)>
        on_turns;  ///< so many turns more are done, of those that GyroRecord::turns counts
};

/// Turns that the whole ensemble will count.
std::int64_t expected_turns(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms);

/// Simulates gyro g of the scenario. The result depends on the scenario, its seed and g alone.
/// Throws RunError where the trajectory cannot be finished, Interrupted when cancelled.
GyroRecord simulate_gyro(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t gyro,
                         const Monitor& monitor);

}  // namespace ringlock::ensemble
