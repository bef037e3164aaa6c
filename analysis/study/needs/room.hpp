#pragma once
#include <cstdint>

#include "engine/scenario/scenario.hpp"

/// Memory and disk space of a run of a scenario with all points of its design; with a stopping rule, the maximum. They
/// follow from the scenario alone. Both throw InputError where complaints() are about the design.
namespace ringlock::study {

/// Memory with that many threads; docs/commands.md gives the accuracy of the estimate.
std::uint64_t expected_memory_bytes(const scenario::Scenario& scenario, int threads);

/// Size of the result. To be called only if the memory suffices: the points of the design are planned for it, each with
/// one gyro.
std::uint64_t expected_disk_bytes(const scenario::Scenario& scenario);

}  // namespace ringlock::study
