#pragma once
#include <string>
#include <string_view>

namespace ringlock::closure {

/// How a language writes a comment.
enum class Comment {
    toml,   ///< "# ..."
    markup  ///< "<!-- ... -->": Markdown, SVG
};

/// The text with a last line, a comment, that says that `ringlock closure` wrote it and gives its checksum (CRC-32).
std::string sealed(std::string text, Comment comment);

/// Whether the text is one that sealed() made, unchanged since.
bool is_sealed(std::string_view text);

}  // namespace ringlock::closure
