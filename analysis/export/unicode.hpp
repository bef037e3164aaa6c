#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace ringlock::exports {

/// The characters of a text in UTF-8; U+FFFD for each byte that is part of none.
inline std::u32string code_points(std::string_view text) {
    std::u32string out;
    const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(text[at]); };
    for (std::size_t at = 0; at < text.size();) {
        const unsigned char first = byte(at);
        const std::size_t length = first < 0x80       ? 1
                                   : first >> 5 == 6  ? 2
                                   : first >> 4 == 14 ? 3
                                   : first >> 3 == 30 ? 4
                                                      : 0;
        char32_t value = length == 1 ? first : length == 0 ? 0 : first & (0xffu >> (length + 1));
        bool valid = length > 0 && at + length <= text.size();
        for (std::size_t i = 1; valid && i < length; ++i) {
            valid = byte(at + i) >> 6 == 2;
            value = (value << 6) | (byte(at + i) & 0x3fu);
        }
        constexpr char32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
        valid = valid && value >= least[length] && value <= 0x10ffff && (value < 0xd800 || value > 0xdfff);
        out += valid ? value : U'\ufffd';
        at += valid ? length : 1;
    }
    return out;
}

/// The same in UTF-16.
inline std::vector<std::uint16_t> utf16_units(std::string_view text) {
    std::vector<std::uint16_t> out;
    for (const char32_t character : code_points(text)) {
        if (character < 0x10000) {
            out.push_back(static_cast<std::uint16_t>(character));
        } else {
            out.push_back(static_cast<std::uint16_t>(0xd800 + ((character - 0x10000) >> 10)));
            out.push_back(static_cast<std::uint16_t>(0xdc00 + ((character - 0x10000) & 0x3ff)));
        }
    }
    return out;
}

}  // namespace ringlock::exports
