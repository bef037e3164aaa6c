#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/scenario/scenario.hpp"

/// Rules between the keys of a scenario, which no single key can express.
namespace ringlock::scenario {

/// A rule that a scenario breaks.
struct Complaint {
    std::vector<std::string> keys;  ///< paths of the keys involved, the likeliest culprit first
    std::string problem;            ///< values found and values allowed
};

/// Every rule that the scenario breaks.
std::vector<Complaint> check(const Scenario& scenario);

/// One sentence for each rule.
std::vector<std::string_view> rules();

}  // namespace ringlock::scenario
