#include "app/allan/repeated_input.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <string_view>
#include <system_error>

#include "engine/core/error.hpp"
#include "engine/core/waiting.hpp"

namespace ringlock::app {
namespace {

[[noreturn]] void fail_to_keep(int error) {
    throw RunError(
        fmt::format("standard input cannot be kept in a temporary file to be read again: {}; write it to a "
                    "file and name that",
                    std::generic_category().message(error)));
}

/// Standard input becomes a file with the rest of it.
void keep_standard_input() {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::tmpfile(), &std::fclose);
    if (!file) fail_to_keep(errno);
    std::array<char, 65536> piece{};
    for (;;) {
        const ssize_t got = read_some(STDIN_FILENO, piece.data(), piece.size());
        if (got < 0) {
            throw InputError(fmt::format("standard input: cannot be read: {}", std::generic_category().message(errno)));
        }
        if (got == 0) break;
        const int error = write_all(fileno(file.get()), std::string_view(piece.data(), static_cast<std::size_t>(got)));
        if (error != 0) fail_to_keep(error);
    }
    if (::dup2(fileno(file.get()), STDIN_FILENO) < 0) fail_to_keep(errno);
}

}  // namespace

RepeatedInput::RepeatedInput(bool needed) : needed_(needed) {
    if (!needed_) return;
    begin_ = ::lseek(STDIN_FILENO, 0, SEEK_CUR);
    if (begin_ >= 0) return;
    begin_ = 0;
    keep_standard_input();
}

void RepeatedInput::rewind() const {
    if (needed_) ::lseek(STDIN_FILENO, begin_, SEEK_SET);
}

}  // namespace ringlock::app
