#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/allan/estimator.hpp"
#include "engine/scenario/scenario.hpp"

/// What several commands read from their line.
namespace ringlock::app {

/// A whole number from 0 in plain decimal digits. CLI11 would take 010 for eight and cut what is too large without a
/// word. Throws InputError.
std::int64_t whole_number(std::string_view option, const std::string& text, std::int64_t largest,
                          std::string_view allowed);

/// The scenario of the file with the seed of --seed in place of its own where that is given.
scenario::Scenario load_scenario(const std::string& file, const std::optional<std::string>& seed);

/// The parts of "a, b, c", without white space around them.
std::vector<std::string> split(const std::string& text);

/// Names of all deviations, for help and errors.
std::string known_deviations();

/// The deviations of a list such as --dev has, each once. Throws InputError.
std::vector<allan::Estimator> parse_deviations(const std::string& list);

}  // namespace ringlock::app
