#pragma once
#include <CLI/App.hpp>
#include <optional>
#include <string>

#include "analysis/text/options.hpp"

namespace ringlock::app {

/// Options of a command line for a text of measured data (docs/field-data.md).
struct TextArguments {
    std::string header;     ///< of --header
    std::string skip;       ///< of --skip
    std::string delimiter;  ///< of --delimiter
    std::string time_unit;  ///< of --time-unit

    bool any() const { return !header.empty() || !skip.empty() || !delimiter.empty() || !time_unit.empty(); }
};

/// Adds --header, --skip, --delimiter and --time-unit.
void add_text_options(CLI::App& command, TextArguments& arguments);

/// Checked. Throws InputError.
text::Options text_options(const TextArguments& arguments);

/// Checked; only where there are times (`has_time`). Throws InputError.
std::optional<std::string> time_unit_of(const TextArguments& arguments, bool has_time);

}  // namespace ringlock::app
