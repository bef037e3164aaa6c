#include "analysis/report/gnuplot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <string_view>
#include <system_error>
#include <utility>

#include "engine/core/error.hpp"

extern char** environ;

namespace ringlock::report {
namespace {

std::string reason(int error) { return std::generic_category().message(error); }

class Descriptor {
   public:
    explicit Descriptor(int fd) : fd_(fd) {}
    Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }

    int get() const { return fd_; }

   private:
    int fd_;
};

/// Removes a file at the end of its scope.
class Removal {
   public:
    explicit Removal(std::filesystem::path path) : path_(std::move(path)) {}
    Removal(const Removal&) = delete;
    Removal& operator=(const Removal&) = delete;
    ~Removal() {
        std::error_code ignored;
        std::filesystem::remove(path_, ignored);
    }

   private:
    std::filesystem::path path_;
};

Descriptor memory_file(const char* name) {
    Descriptor file(::memfd_create(name, MFD_CLOEXEC));
    if (file.get() < 0) throw RunError(fmt::format("cannot make a buffer for gnuplot: {}", reason(errno)));
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

    int status = 0;
    while (::waitpid(child, &status, 0) < 0) {
        if (errno != EINTR) throw RunError(fmt::format("lost sight of gnuplot: {}", reason(errno)));
    }
    return status;
}

}  // namespace

void run_gnuplot(const std::string& script, const std::filesystem::path& output) {
    const std::filesystem::path partial = output.string() + fmt::format(".{}.partial", ::getpid());
    const Descriptor in = readable(script);
    const Descriptor messages = memory_file("gnuplot-messages");
    const Descriptor out(::open(partial.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
    if (out.get() < 0) throw RunError(fmt::format("cannot write {}: {}", output.string(), reason(errno)));
    const Removal removal(partial);

    const int status = run(in.get(), out.get(), messages.get());
    if (WIFSIGNALED(status)) {
        throw RunError(
            fmt::format("cannot draw {}: gnuplot was ended by signal {}", output.string(), WTERMSIG(status)));
    }
    if (WEXITSTATUS(status) != 0) {
        throw RunError(fmt::format("cannot draw {}: gnuplot failed: {}", output.string(), complaint(messages.get())));
    }
    // gnuplot does not notice when the disk is full.
    const std::string end = tail(out.get(), 32);
    if (end.find("</svg>") == std::string::npos) {
        throw RunError(fmt::format("cannot draw {}: gnuplot left it incomplete (is the disk full?): {}",
                                   output.string(), complaint(messages.get())));
    }
    if (::fsync(out.get()) != 0 && errno != EINVAL) {
        throw RunError(fmt::format("cannot write {}: {}", output.string(), reason(errno)));
    }
    std::error_code error;
    std::filesystem::rename(partial, output, error);
    if (error) throw RunError(fmt::format("cannot write {}: {}", output.string(), error.message()));
}

}  // namespace ringlock::report
