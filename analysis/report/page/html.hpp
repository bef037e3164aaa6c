#pragma once
#include <string>
#include <string_view>

namespace ringlock::report {

/// Text as it may stand in HTML and SVG, between tags and in attributes with double quotes. Control characters are
/// shown as printable() writes them.
std::string html_escaped(std::string_view text);

/// The same of a text of several lines, whose newlines and tabs stay: for <pre>.
std::string html_escaped_lines(std::string_view text);

}  // namespace ringlock::report
