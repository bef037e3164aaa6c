#pragma once
#include <string>
#include <string_view>

namespace ringlock::closure {

/// Form of a comment in a language.
enum class Comment {
    toml,   ///< "# ..."
    markup  ///< "<!-- ... -->": Markdown, SVG
};

/// The text with an additional last line, a comment: `ringlock closure` wrote it, and its checksum (CRC-32).
std::string sealed(std::string text, Comment comment);

/// Whether the text was made by sealed() and is unchanged since.
bool is_sealed(std::string_view text);

}  // namespace ringlock::closure
