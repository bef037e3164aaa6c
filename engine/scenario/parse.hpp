#pragma once
#include <filesystem>
#include <string_view>

#include "engine/scenario/scenario.hpp"

namespace ringlock::scenario {

/// Reads and validates a scenario. Keys that are not named have their defaults; an empty file is valid.
/// @throws InputError with every problem of the file, one a line: FILE:LINE:COLUMN, key, value, what is allowed.
Scenario parse_file(const std::filesystem::path& path);

/// The same for text; `name` stands in messages in place of the file.
Scenario parse_string(std::string_view text, std::string_view name);

}  // namespace ringlock::scenario
