#include "app/output.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <system_error>

#include "engine/core/error.hpp"

namespace ringlock::app {

void put(std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0) return;
    throw RunError(fmt::format("standard output cannot be written: {}", std::generic_category().message(errno)));
}

}  // namespace ringlock::app
