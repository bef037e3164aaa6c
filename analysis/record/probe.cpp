#include "analysis/record/probe.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>

#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/waiting.hpp"

namespace ringlock::record {
namespace {

/// Seconds that reading may take: what a slow disk needs, and time enough for anything else.
unsigned patience_s(const std::string& path) {
    constexpr double slowest_bytes_s = 1e6;
    constexpr double least_s = 60.0;
    constexpr double most_s = 1e6;
    std::error_code error;
    const auto bytes = static_cast<double>(std::filesystem::file_size(path, error));
    return static_cast<unsigned>(error ? least_s : std::min(most_s, least_s + bytes / slowest_bytes_s));
}

[[noreturn]] void be_the_probe(const std::function<void()>& read, unsigned seconds) {
    // A crash of the probe is no news: no core, no handler's report, none of the messages that the reader will give.
    const rlimit none{0, 0};
    setrlimit(RLIMIT_CORE, &none);
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGALRM, SIGINT, SIGTERM, SIGHUP}) {
        std::signal(signal, SIG_DFL);
    }
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (nowhere >= 0) {
        dup2(nowhere, STDOUT_FILENO);
        dup2(nowhere, STDERR_FILENO);
    }
    alarm(seconds);
    try {
        read();
    } catch (...) {
        _exit(0);  // wrong, but readable enough to be told so
    }
    _exit(0);
}

}  // namespace

void try_reading(const std::string& path, const std::function<void()>& read) {
    const unsigned seconds = patience_s(path);
    const pid_t probe = fork();
    if (probe == 0) be_the_probe(read, seconds);
    if (probe < 0) throw RunError(fmt::format("{}: cannot be read: {}", path, std::strerror(errno)));
    const int status = wait_for_child(probe);
    check_interrupt();         // Ctrl-C reaches the probe, too
    if (status == -1) return;  // nobody knows: somebody else waits for our children
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
    throw InputError(
        fmt::format("{}: is damaged: the HDF5 library does not get through it; take another copy, or have "
                    "h5dump show what is left",
                    path));
}

}  // namespace ringlock::record
