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

/// Text of a scenario's file. Throws InputError where it cannot be read or is no scenario by its size.
std::string text_of_file(const std::filesystem::path& path);

/// toml++ 3.3 follows a dotted key by recursion without a limit, and a key of some 30 000 parts overflows the stack.
/// A key has at most three parts here, so that a run of dots is refused before it is parsed. Dots side by side are
/// decoration, and so is a line of comment.
///
/// A file with more keys, sections or values than any scenario has is refused, too, before there is a table of all.
/// Throws InputError; `name` is printable.
void refuse_before_parsing(std::string_view text, std::string_view name);

/// Rules that a scenario must obey once each of its keys is correct.
using Rules = std::function<std::vector<Complaint>(const Scenario&)>;

/// Reads and validates a scenario. Keys that are not named have their defaults; an empty file is valid.
///
/// \param settings  "section.key=value" each, which replaces the file's value of that key; a later setting replaces an
/// earlier one. Values are TOML, a word without quotes is a string.
/// \param rules     those of a study are study::complaints(), which looks at every point of a design
/// @throws InputError with every problem of the file, one a line: FILE:LINE:COLUMN, key, value, allowed values. For an
/// error in a setting its text stands in place of the position, after `setting_word`.
Scenario parse_file(const std::filesystem::path& path, std::span<const std::string> settings = {},
                    const Rules& rules = check, std::string_view setting_word = "--set");

/// The same for text; `name` stands in messages in place of the file.
Scenario parse_string(std::string_view text, std::string_view name, std::span<const std::string> settings = {},
                      const Rules& rules = check, std::string_view setting_word = "--set");

}  // namespace ringlock::scenario
