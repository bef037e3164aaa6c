#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

/// Words of files in messages.
namespace ringlock::text {

/// White space within a line.
inline bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

/// Without white space at either end.
std::string_view trimmed(std::string_view s);

/// In small letters of ASCII.
std::string lowered(std::string_view s);

/// Text of a file as it may stand in a message.
std::string shown(std::string_view text);

/// A whole number of digits alone, such as that of a column or a line.
bool parse_index(std::string_view text, std::size_t& index);

/// The path that stands for standard input, and how messages call a file.
inline constexpr std::string_view standard_input = "-";
std::string name_of_file(const std::string& path);

/// "a, b, c", at most the first 20.
std::string listed(const std::vector<std::string>& names);

/// The name that `asked` may have been meant to be: another case, or few letters different; empty if there is no such
/// name.
std::string nearest(const std::string& asked, const std::vector<std::string>& names);

}  // namespace ringlock::text
