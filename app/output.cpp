#include "app/output.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "analysis/report/render.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/waiting.hpp"

namespace ringlock::app {

namespace {

/// Arguments of the command line that would break the lines of a message.
std::vector<std::string> broken_arguments;

/// A message in which nothing controls the terminal. Newlines are ours, unless they are those of an argument.
std::string safe(std::string_view message) {
    std::string text(message);
    for (const std::string& argument : broken_arguments) {
        const std::string shown = printable(argument);
        for (std::size_t at = 0; (at = text.find(argument, at)) != std::string::npos; at += shown.size()) {
            text.replace(at, argument.size(), shown);
        }
    }
    return without_controls(text);
}

/// Whether standard error is a terminal that shows colours and whose user wants them (no-color.org).
bool has_colours() {
    const char* const refused = std::getenv("NO_COLOR");
    const char* const terminal = std::getenv("TERM");
    if (refused != nullptr && *refused != '\0') return false;
    return isatty(STDERR_FILENO) == 1 && terminal != nullptr && std::string_view(terminal) != "dumb";
}

}  // namespace

std::string coloured(std::string message) {
    constexpr std::string_view name = "ringlock: ";
    constexpr std::string_view red = "\x1b[1;31m";
    constexpr std::string_view yellow = "\x1b[1;33m";
    if (!message.starts_with(name) || !has_colours()) return message;
    for (const auto& [word, colour] : {std::pair{std::string_view("error:"), red}, {"warning:", yellow}}) {
        if (message.compare(name.size(), word.size(), word) != 0) continue;
        message.replace(name.size(), word.size(), fmt::format("{}{}\x1b[0m", colour, word));
    }
    return message;
}

void remember_arguments(std::span<const char* const> arguments) {
    for (const std::string_view argument : arguments.subspan(std::min<std::size_t>(1, arguments.size()))) {
        if (argument.find_first_of("\n\t") != std::string_view::npos) broken_arguments.emplace_back(argument);
    }
}

void put(std::string_view text) {
    const int error = write_all(STDOUT_FILENO, safe(text));
    if (error == 0) return;
    throw RunError(fmt::format("standard output cannot be written: {}", std::generic_category().message(error)));
}

void draw_over(std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), stderr) != text.size()) std::clearerr(stderr);
}

void tell(std::string_view text) { draw_over(coloured(safe(text))); }

std::unique_ptr<AtomicPath> claim_figure(const std::filesystem::path& path) {
    if (path.empty()) return nullptr;
    report::picture_of(path.string(), "--plot");
    return std::make_unique<AtomicPath>(path);
}

void hold_standard_streams() {
    // The lowest number that is free is given. Standard output is opened for reading, so that writing to it fails.
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
        if (fcntl(stream, F_GETFD) < 0 && errno == EBADF) {
            static_cast<void>(open("/dev/null", stream == STDERR_FILENO ? O_WRONLY : O_RDONLY));
        }
    }
}

}  // namespace ringlock::app
