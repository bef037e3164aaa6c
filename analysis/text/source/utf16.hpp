#pragma once
#include <memory>
#include <string>
#include <string_view>

#include "analysis/text/source/source.hpp"

/// Text whose characters have two bytes, as Windows programs write it.
namespace ringlock::text {

enum class Encoding {
    bytes,     ///< ASCII, UTF-8 or a code page: its bytes are taken as they are
    marked,    ///< UTF-8 with a mark of the byte order in front
    utf16_le,  ///< low byte first
    utf16_be,
};

/// Detected by the mark of the byte order or, without a mark, by zero bytes in every other position.
Encoding encoding_of(std::string_view first);

/// UTF-8 without the mark. Throws InputError, naming the character, where the bytes are no UTF-16.
std::unique_ptr<Source> decode(std::unique_ptr<Source> from, Encoding encoding, const std::string& name);

}  // namespace ringlock::text
