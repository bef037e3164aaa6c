#pragma once
#include <cstdint>

#include "analysis/record/record.hpp"
#include "engine/scenario/scenario.hpp"

/// Records of gyros that are simulated.
namespace ringlock::instrument {

/// The record of an instrumented gyro of the scenario, by its section [record]: gyro `gyro` of its ensemble over
/// ensemble.duration_s after ensemble.settle_s. Times count from the start of the run, as those of effects do. Rows are
/// the data of the electronics: neither the detectors' ellipse nor the phase is improved.
///
/// /declared holds the scenario's own values, /reference the input rate, /environment the temperature where it changes:
/// `start_temperature_c` at the start.
///
/// Throws InputError where the scenario has no such gyro or the trajectory breaks one of its rules, RunError where the
/// trajectory cannot be followed, Interrupted.
record::Record simulate_record(const scenario::Scenario& scenario, std::int64_t gyro = 0);

/// Memory that such a record takes while it is made, and its size on the disk.
struct Room {
    std::uint64_t memory_bytes = 0;
    std::uint64_t disk_bytes = 0;
};

/// Estimated from the scenario alone, before anything is simulated; at most. Throws InputError as simulate_record()
/// does.
Room expected_room(const scenario::Scenario& scenario, std::int64_t gyro = 0);

inline constexpr double start_temperature_c = 20.0;

}  // namespace ringlock::instrument
