#pragma once
#include <cstddef>
#include <optional>
#include <string>

namespace ringlock::text {

/// The user's description of a text; omitted properties are detected.
struct Options {
    enum class Header {
        detect,
        yes,   ///< the first line behind those skipped that is neither empty nor a comment
        no,    ///< the table has no header: rows begin at once
        line,  ///< line `header_line`, be it a comment
    };
    Header header = Header::detect;
    std::size_t header_line = 0;    ///< from 1
    std::size_t skip = 0;           ///< lines at the start that do not count
    std::optional<char> delimiter;  ///< ' ' is white space
    bool quiet = false;             ///< no notes: the file was read before, with its notes
};

/// Options by the words of --header (yes, no or a line) and --delimiter (comma, semicolon, tab, space or a character).
/// Throws InputError.
void set_header(Options& options, const std::string& word);
void set_delimiter(Options& options, const std::string& word);

}  // namespace ringlock::text
