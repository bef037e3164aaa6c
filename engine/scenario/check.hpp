#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/scenario/scenario.hpp"

/// What no single key can say: rules between keys.
namespace ringlock::scenario {

/// A rule that a scenario breaks.
struct Complaint {
    std::vector<std::string> keys;  ///< paths of the keys involved, the likeliest culprit first
    std::string problem;            ///< what is found and what is allowed
};

/// Every rule that the scenario breaks.
std::vector<Complaint> check(const Scenario& scenario);

/// One sentence for each rule.
std::vector<std::string_view> rules();

}  // namespace ringlock::scenario
