#pragma once
#include <cstdint>

#include "engine/scenario/scenario.hpp"

/// What a run of a scenario takes with all points of its design; with a stopping rule, at most. Known from the scenario
/// alone. Both throw InputError where complaints() are about the design.
namespace ringlock::study {

/// Memory on so many threads; docs/commands.md says how well it is met.
std::uint64_t expected_memory_bytes(const scenario::Scenario& scenario, int threads);

/// Size of the result. To be asked where the memory suffices: the points of the design are planned for it, each with
/// one gyro.
std::uint64_t expected_disk_bytes(const scenario::Scenario& scenario);

}  // namespace ringlock::study
