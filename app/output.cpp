#include "app/output.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <system_error>

#include "engine/core/error.hpp"
#include "engine/core/waiting.hpp"

namespace ringlock::app {

void put(std::string_view text) {
    const int error = write_all(STDOUT_FILENO, text);
    if (error == 0) return;
    throw RunError(fmt::format("standard output cannot be written: {}", std::generic_category().message(error)));
}

void tell(std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), stderr) != text.size()) std::clearerr(stderr);
}

std::unique_ptr<AtomicPath> claim_figure(const std::filesystem::path& path) {
    if (path.empty()) return nullptr;
    if (path.extension() != ".svg") {
        throw InputError(fmt::format("--plot {}: the name of a figure must end in .svg", path.string()));
    }
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
