#pragma once
#include <nlohmann/json.hpp>
#include <string>

namespace ringlock {

namespace detail {
std::string with_controls_escaped(const std::string& json);
}

/// A JSON value as text, for files and standard output. Bytes in strings that are no UTF-8 become U+FFFD, since no JSON
/// can hold them; controls beyond ASCII and marks of direction are written as \uXXXX, which readers of JSON decode.
///
/// \param indent  blanks a level, or -1 for one line
template <class Json>
std::string json_text(const Json& json, int indent = -1) {
    return detail::with_controls_escaped(json.dump(indent, ' ', false, Json::error_handler_t::replace));
}

}  // namespace ringlock
