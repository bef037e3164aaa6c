#include "engine/core/printable.hpp"

#include <fmt/format.h>

#include <cstddef>

namespace ringlock {
namespace {

constexpr char32_t no_character = 0xffffffff;

struct Decoded {
    char32_t character = no_character;  ///< no_character where the bytes are no UTF-8
    std::size_t bytes = 1;
};

/// The character that the text begins with, by RFC 3629: no overlong form, no surrogate, nothing beyond U+10FFFF.
Decoded decode(std::string_view text) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned char first = byte(0);
    if (first < 0x80) return {first, 1};
    const std::size_t bytes = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
    if (first < 0xc2 || first > 0xf4 || text.size() < bytes) return {};
    char32_t character = first & (0xffU >> (bytes + 1));
    for (std::size_t i = 1; i < bytes; ++i) {
        if ((byte(i) & 0xc0U) != 0x80) return {};
        character = (character << 6U) | (byte(i) & 0x3fU);
    }
    constexpr char32_t least[] = {0x80, 0x800, 0x10000};
    const bool surrogate = character >= 0xd800 && character <= 0xdfff;
    if (character < least[bytes - 2] || character > 0x10ffff || surrogate) return {};
    return {character, bytes};
}

/// Whether a character controls a terminal or the layout of text instead of being shown.
bool is_control(char32_t c) {
    const auto between = [c](char32_t first, char32_t last) { return c >= first && c <= last; };
    return c < 0x20 || between(0x7f, 0x9f)            // C0, DEL, C1
           || c == 0x061c || between(0x200e, 0x200f)  // marks of direction
           || between(0x2028, 0x202e)                 // separators of lines and paragraphs, embeddings, overrides
           || between(0x2066, 0x2069)                 // isolates
           || c == 0xfeff || between(0xfff9, 0xfffb) || between(0xe0000, 0xe007f);  // joins, annotations, tags
}

std::string written_out(std::string_view text, bool keep_layout) {
    std::string out;
    out.reserve(text.size());
    while (!text.empty()) {
        const Decoded next = decode(text);
        const bool layout = keep_layout && (text.front() == '\n' || text.front() == '\t');
        if (next.character == no_character) {
            out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text.front()));
        } else if (layout || !is_control(next.character)) {
            out += text.substr(0, next.bytes);
        } else if (next.character < 0x80) {
            out += fmt::format("\\x{:02x}", static_cast<unsigned>(next.character));
        } else if (next.character <= 0xffff) {
            out += fmt::format("\\u{:04x}", static_cast<unsigned>(next.character));
        } else {
            // As a pair of surrogates, which JSON takes for one character.
            const unsigned rest = static_cast<unsigned>(next.character) - 0x10000U;
            out += fmt::format("\\u{:04x}\\u{:04x}", 0xd800U + (rest >> 10U), 0xdc00U + (rest & 0x3ffU));
        }
        text.remove_prefix(next.bytes);
    }
    return out;
}

}  // namespace

std::string printable(std::string_view text) { return written_out(text, false); }
std::string printable(const std::string& text) { return written_out(text, false); }
std::string printable(const char* text) { return written_out(text, false); }
std::string printable(const std::filesystem::path& path) { return written_out(path.native(), false); }

std::string markdown(std::string_view text) {
    std::string out;
    for (const char c : written_out(text, false)) {
        switch (c) {
            case '<':
                out += "&lt;";
                break;
            case '>':
                out += "&gt;";
                break;
            case '&':
                out += "&amp;";
                break;
            case '\\':
            case '`':
            case '*':
            case '[':
            case ']':
            case '|':
                out += '\\';
                [[fallthrough]];
            default:
                out += c;
        }
    }
    return out;
}

std::string without_controls(std::string_view message) { return written_out(message, true); }

}  // namespace ringlock
