#pragma once
#include <string>
#include <vector>

#include "engine/scenario/scenario.hpp"

namespace ringlock::scenario {

/// The keys in which two scenarios differ, one line each with both values: "ensemble.gyros: 100 before, 200 now". For
/// sections that may occur several times, the line has the name of the section alone.
std::vector<std::string> differences(const Scenario& before, const Scenario& now);

}  // namespace ringlock::scenario
