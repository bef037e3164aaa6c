#pragma once
#include <string>
#include <string_view>

#include "engine/core/error.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::scenario {

/// The error of the parser about the text of a scenario; empty where it accepts it.
inline std::string complaint(std::string_view text) {
    try {
        parse_string(text, "s.toml");
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

}  // namespace ringlock::scenario
