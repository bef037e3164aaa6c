#pragma once
#include <cstdint>

#include "engine/scenario/scenario.hpp"

namespace ringlock::study {

/// What a run takes.
struct Room {
    std::uint64_t memory_bytes = 0;
    std::uint64_t disk_bytes = 0;
};

/// What a run of the scenario takes with all points of its design; with a stopping rule, at most. Known from the
/// scenario alone: nothing of that size is taken to find out. docs/commands.md says how well the memory is met.
/// Throws InputError where complaints() are about the design.
Room expected_room(const scenario::Scenario& scenario, int threads);

}  // namespace ringlock::study
