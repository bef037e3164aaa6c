#include "engine/scenario/arm.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "engine/core/error.hpp"
#include "engine/scenario/text/text.hpp"

namespace ringlock::scenario {
namespace {

constexpr std::string_view injected_prefix = "noise_injected+";

struct CompensatorName {
    std::string_view name;
    Compensator value;
};
constexpr std::array compensators = {
    CompensatorName{"compensated_published", Compensator::published},
    CompensatorName{"compensated", Compensator::corrected},
    CompensatorName{"compensated_exact", Compensator::exact},
    CompensatorName{"compensated_adaptive", Compensator::adaptive},
    CompensatorName{"compensated_extrapolated", Compensator::extrapolated},
    CompensatorName{"compensated_two_train", Compensator::two_train},
};

std::vector<Arm> all_arms() {
    std::vector<Arm> arms = {
        {.name = "ideal", .ideal = true},
        {.name = "uncompensated"},
        {.name = "noise_injected", .noise_injected = true},
    };
    for (const CompensatorName& c : compensators) {
        arms.push_back({.name = std::string(c.name), .compensator = c.value});
    }
    for (const CompensatorName& c : compensators) {
        arms.push_back(
            {.name = fmt::format("{}{}", injected_prefix, c.name), .noise_injected = true, .compensator = c.value});
    }
    return arms;
}

}  // namespace

std::vector<std::string> arm_names() {
    std::vector<std::string> names;
    for (const Arm& arm : all_arms()) names.push_back(arm.name);
    return names;
}

Arm parse_arm(std::string_view name) {
    const std::vector<Arm> arms = all_arms();
    const auto found = std::find_if(arms.begin(), arms.end(), [name](const Arm& arm) { return arm.name == name; });
    if (found != arms.end()) return *found;

    const std::vector<std::string> known = arm_names();
    throw InputError(fmt::format("arm {}: unknown arm{}; arms are: {}", in_quotes(name), did_you_mean(name, known),
                                 fmt::join(known, ", ")));
}

std::vector<Arm> parse_arms(const std::vector<std::string>& names) {
    std::vector<Arm> arms;
    for (const std::string& name : names) arms.push_back(parse_arm(name));
    return arms;
}

}  // namespace ringlock::scenario
