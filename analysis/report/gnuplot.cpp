#include "analysis/report/gnuplot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <limits>
#include <string_view>
#include <system_error>

#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/waiting.hpp"

extern char** environ;

namespace ringlock::report {
namespace {

std::string reason(int error) { return std::generic_category().message(error); }

Descriptor memory_file(const char* name) {
    Descriptor file(::memfd_create(name, MFD_CLOEXEC));
    if (!file.valid()) throw RunError(fmt::format("cannot make a buffer for gnuplot: {}", reason(errno)));
    return file;
}

// A file in memory rather than a pipe: gnuplot may stop reading or fill its standard error at any moment, and neither
// SIGPIPE nor a deadlock can follow.
Descriptor readable(std::string_view text) {
    Descriptor file = memory_file("gnuplot-script");
    while (!text.empty()) {
        const ssize_t n = ::write(file.get(), text.data(), text.size());
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) throw RunError(fmt::format("cannot hand the figure to gnuplot: {}", reason(errno)));
        text.remove_prefix(static_cast<std::size_t>(n));
    }
    ::lseek(file.get(), 0, SEEK_SET);
    return file;
}

/// The last `limit` bytes at most.
std::string tail(int fd, off_t limit) {
    const off_t size = ::lseek(fd, 0, SEEK_END);
    if (size <= 0) return {};
    const off_t begin = size > limit ? size - limit : 0;
    std::string text(static_cast<std::size_t>(size - begin), '\0');
    const ssize_t n = ::pread(fd, text.data(), text.size(), begin);
    text.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
    return text;
}

/// What gnuplot said, on one line.
std::string complaint(int fd) {
    std::string line;
    for (const char c : tail(fd, 2000)) {
        const bool blank = c == '\n' || c == '\t' || c == ' ';
        if (!blank) {
            line += c;
        } else if (!line.empty() && line.back() != ' ') {
            line += ' ';
        }
    }
    while (!line.empty() && line.back() == ' ') line.pop_back();
    return line.empty() ? "it gave no reason" : line;
}

/// Exit status as of waitpid.
int run(int in, int out, int err) {
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
    posix_spawn_file_actions_adddup2(&actions, in, STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, err, STDERR_FILENO);
    sigset_t signals;
    sigemptyset(&signals);
    posix_spawnattr_setsigmask(&attributes, &signals);
    sigaddset(&signals, SIGPIPE);
    posix_spawnattr_setsigdefault(&attributes, &signals);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);

    char name[] = "gnuplot";
    char defaults[] = "--default-settings";
    char from_input[] = "-";
    char* arguments[] = {name, defaults, from_input, nullptr};
    pid_t child = 0;
    const int error = ::posix_spawnp(&child, name, &actions, &attributes, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    if (error == ENOENT) {
        throw RunError("figures need gnuplot, which is not installed: install the Debian package gnuplot-nox");
    }
    if (error != 0) throw RunError(fmt::format("cannot start gnuplot: {}", reason(error)));

    const int status = wait_for_child(child);
    if (status == -1) throw RunError(fmt::format("lost sight of gnuplot: {}", reason(errno)));
    return status;
}

}  // namespace

std::string literal(std::string_view text) {
    std::string out = "\"";
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == ' ';
        if (plain || byte < 0x20 || byte == 0x7F) {
            out += plain ? c : ' ';
        } else {
            out += fmt::format("\\{:03o}", byte);
        }
    }
    return out + "\"";
}

std::string run_gnuplot(const std::string& script, const std::string& shown_as) {
    const Descriptor in = readable(script);
    const Descriptor out = memory_file("gnuplot-figure");
    const Descriptor messages = memory_file("gnuplot-messages");
    const int status = run(in.get(), out.get(), messages.get());
    check_interrupt();  // Ctrl-C reaches gnuplot, too
    if (WIFSIGNALED(status)) {
        throw RunError(fmt::format("cannot draw {}: gnuplot was ended by signal {}", shown_as, WTERMSIG(status)));
    }
    if (WEXITSTATUS(status) != 0) {
        throw RunError(fmt::format("cannot draw {}: gnuplot failed: {}", shown_as, complaint(messages.get())));
    }
    std::string figure = tail(out.get(), std::numeric_limits<off_t>::max());
    // gnuplot does not notice when it cannot write.
    if (figure.find("</svg>") == std::string::npos) {
        throw RunError(fmt::format("cannot draw {}: gnuplot left it incomplete (is the memory full?): {}", shown_as,
                                   complaint(messages.get())));
    }
    return figure;
}

}  // namespace ringlock::report
