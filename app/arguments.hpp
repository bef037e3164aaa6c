#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "engine/scenario/scenario.hpp"

/// What several commands read from their line.
namespace ringlock::app {

/// A whole number from 0 in plain decimal digits. CLI11 would take 010 for eight and cut what is too large without a
/// word. Throws InputError.
std::int64_t whole_number(std::string_view option, const std::string& text, std::int64_t largest,
                          std::string_view allowed);

/// The scenario of the file with the seed of --seed in place of its own where that is given.
scenario::Scenario load_scenario(const std::string& file, const std::optional<std::string>& seed);

}  // namespace ringlock::app
