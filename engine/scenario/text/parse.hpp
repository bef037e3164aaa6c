#pragma once
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/scenario/check.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::scenario {

/// Rules that a scenario must obey once each of its keys is correct.
using Rules = std::function<std::vector<Complaint>(const Scenario&)>;

/// Reads and validates a scenario. Keys that are not named have their defaults; an empty file is valid.
///
/// \param settings  "section.key=value" each, which replaces the file's value of that key; a later setting replaces an
/// earlier one. Values are TOML, a word without quotes is a string.
/// \param rules     those of a study are study::complaints(), which looks at every point of a design
/// @throws InputError with every problem of the file, one a line: FILE:LINE:COLUMN, key, value, allowed values. For an
/// error in a setting its text stands in place of the position.
Scenario parse_file(const std::filesystem::path& path, std::span<const std::string> settings = {},
                    const Rules& rules = check);

/// The same for text; `name` stands in messages in place of the file.
Scenario parse_string(std::string_view text, std::string_view name, std::span<const std::string> settings = {},
                      const Rules& rules = check);

}  // namespace ringlock::scenario
