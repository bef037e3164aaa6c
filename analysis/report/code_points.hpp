#pragma once
#include <algorithm>
#include <cstddef>
#include <string_view>

namespace ringlock::report {

/// Number of code points of a text in UTF-8: bytes that do not continue another one.
inline std::size_t code_points(std::string_view text) {
    return static_cast<std::size_t>(
        std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

}  // namespace ringlock::report
