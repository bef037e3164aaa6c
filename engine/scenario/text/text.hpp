#pragma once
#include <string>
#include <string_view>
#include <vector>

/// Words of messages about a scenario.
namespace ringlock::scenario {

/// Shortest text that reads back as the same double and is a TOML float: "300.0", "1e-10", "nan".
std::string format_real(double value);

/// In double quotes, control characters escaped, cut after 60 bytes: safe to print for any content of a file.
std::string in_quotes(std::string_view text);

/// ` (did you mean "gyros"?)` for the candidate closest to a mistyped word, or nothing where none is close.
std::string did_you_mean(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace ringlock::scenario
