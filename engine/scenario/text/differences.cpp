#include "engine/scenario/text/differences.hpp"

#include <fmt/format.h>

#include "engine/scenario/keys/schema.hpp"

namespace ringlock::scenario {

namespace {

/// All elements of a section that may stand several times, as text.
std::string elements_of(const Section& section, const Scenario& scenario) {
    std::string text;
    for (std::size_t i = 0; i < section.elements->count(scenario); ++i) {
        Scenario up_to_it = scenario;
        section.elements->resize(up_to_it, i + 1);
        for (const Key& key : section.keys) text += fmt::format("{}\n", to_toml(key.get(up_to_it)));
    }
    return text;
}

}  // namespace

std::vector<std::string> differences(const Scenario& before, const Scenario& now) {
    std::vector<std::string> found;
    for (const Section& section : schema()) {
        if (section.elements) {
            if (elements_of(section, before) != elements_of(section, now)) {
                found.push_back(fmt::format("[[{}]]: others before, others now", section.name));
            }
            continue;
        }
        for (const Key& key : section.keys) {
            const std::string then = to_toml(key.get(before));
            const std::string today = to_toml(key.get(now));
            if (then != today) found.push_back(fmt::format("{}: {} before, {} now", key.path(), then, today));
        }
    }
    return found;
}

}  // namespace ringlock::scenario
