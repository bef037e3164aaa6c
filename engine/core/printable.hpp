#pragma once
#include <filesystem>
#include <string>
#include <string_view>

/// Text that others have written (names of files and datasets, attributes, keys, arguments) as it may stand in a
/// message, a table or a report: nothing in it moves the cursor, forges a line or hides the text behind it.
namespace ringlock {

/// The text with all characters escaped that a terminal would not show as they are: control characters (the newline and
/// the tab among them), the controls of Unicode beyond ASCII, marks that change the direction of writing, separators of
/// lines and bytes that are no UTF-8 as "\x1b" or "\u202e". Everything else stays, letters of any alphabet included.
std::string printable(std::string_view text);
std::string printable(const std::string& text);
std::string printable(const char* text);
/// A name of a file, likewise.
std::string printable(const std::filesystem::path& path);

/// Text as it may stand in a line, a cell or a link of Markdown, and in the HTML that is made of it.
std::string markdown(std::string_view text);

/// A whole message or report likewise, but for its newlines and tabs: those come from the program. It is the last guard
/// before the terminal; foreign text in it has gone through printable().
std::string without_controls(std::string_view message);

}  // namespace ringlock
