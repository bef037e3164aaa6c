#include "engine/store/guard.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>

#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/system_text.hpp"
#include "engine/core/waiting.hpp"
#include "engine/store/library.hpp"
#include "engine/store/without_trial.hpp"

namespace ringlock::store {
namespace {

bool trial = false;
bool left_out = false;
double memory_limit_bytes = 0.0;  // of the trial; 0 where it has none
Links in_force = Links::refuse;

/// How the trial ended, as the first byte that it reports; a message follows where there is one.
enum class Ending : char { fine = 'f', input = 'i', run = 'r', memory = 'm', other = 'o' };

double size_of_file(const std::filesystem::path& path) {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(path, error);
    return error ? 0.0 : static_cast<double>(bytes);
}

/// Seconds of the processor that reading may take; other files that it leads to are of unknown size.
unsigned patience_s(double file_bytes, Links links) {
    constexpr double slowest_bytes_s = 1e6;
    constexpr double most_s = 1e6;
    const double least_s = links == Links::follow ? 60.0 : 2.0;
    return static_cast<unsigned>(std::min(most_s, least_s + file_bytes / slowest_bytes_s));
}

/// Address space of this process.
double address_space_bytes() {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen("/proc/self/statm", "r"), &std::fclose);
    unsigned long long pages = 0;
    if (!file || std::fscanf(file.get(), "%llu", &pages) != 1) return 0.0;
    return static_cast<double>(pages) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

void set_memory_limit() {
    rlimit limit{};
    if (getrlimit(RLIMIT_AS, &limit) != 0) return;
    constexpr double largest = 1e18;
    const auto wanted = static_cast<rlim_t>(std::min(memory_limit_bytes, largest));
    limit.rlim_cur = limit.rlim_max == RLIM_INFINITY ? wanted : std::min(wanted, limit.rlim_max);
    setrlimit(RLIMIT_AS, &limit);
}

void limit_memory(double file_bytes, Links links) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    // The sanitisers take terabytes of addresses for their shadow.
    static_cast<void>(file_bytes);
    static_cast<void>(links);
#else
    constexpr double most_bytes = 200e6;
    const double now = address_space_bytes();
    if (now == 0.0 || links == Links::follow) return;
    memory_limit_bytes = now + file_bytes + most_bytes;
    set_memory_limit();
#endif
}

/// The guard can then report how the child ended.
void lift_memory_limit() {
    if (memory_limit_bytes == 0.0) return;
    memory_limit_bytes = 1e18;
    set_memory_limit();
}

/// A loop without end takes the processor. Waiting is for slow disks and busy machines, which are no fault of the file.
void limit_time(unsigned seconds) {
    constexpr unsigned waiting_s = 120;
    alarm(waiting_s + seconds);
    rlimit limit{};
    if (getrlimit(RLIMIT_CPU, &limit) != 0) return;
    limit.rlim_cur = std::min<rlim_t>(seconds, limit.rlim_max);
    setrlimit(RLIMIT_CPU, &limit);
}

void report(int to, Ending ending, std::string_view message) {
    // Less than a pipe holds, so that nobody has to read it at the same time.
    constexpr std::size_t longest = 60000;
    std::string text(1, static_cast<char>(ending));
    text += message.substr(0, longest);
    for (std::string_view rest = text; !rest.empty();) {
        const ssize_t written = ::write(to, rest.data(), rest.size());
        if (written <= 0) _exit(1);
        rest.remove_prefix(static_cast<std::size_t>(written));
    }
}

struct Trial {
    const std::filesystem::path& path;
    Links links;
    double file_bytes;
    unsigned seconds;
    int report_to;
};

[[noreturn]] void be_the_trial(const Trial& what, const std::function<void()>& read) {
    // A crash of the trial is no news: no core, no handler's report, none of the messages that the reader will give.
    const rlimit none{0, 0};
    setrlimit(RLIMIT_CORE, &none);
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGALRM, SIGXCPU, SIGINT, SIGTERM, SIGHUP}) {
        std::signal(signal, SIG_DFL);
    }
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (nowhere >= 0) {
        dup2(nowhere, STDOUT_FILENO);
        dup2(nowhere, STDERR_FILENO);
    }
    trial = true;
    limit_time(what.seconds);
    limit_memory(what.file_bytes, what.links);
    const auto end = [&](Ending ending, std::string_view message) {
        lift_memory_limit();
        // The parts that were left out may be the cause of the failure.
        if (left_out) ending = Ending::fine;
        report(what.report_to, ending, ending == Ending::fine ? "" : message);
        _exit(0);
    };
    try {
        read();
        end(Ending::fine, "");
    } catch (const InputError& error) {
        end(Ending::input, error.what());
    } catch (const RunError& error) {
        end(Ending::run, error.what());
    } catch (const std::bad_alloc&) {
        end(Ending::memory, "");
    } catch (const std::length_error&) {
        end(Ending::memory, "");
    } catch (const std::exception& error) {
        end(Ending::other, error.what());
    } catch (...) {
        end(Ending::other, "an exception without a message");
    }
    _exit(1);
}

std::string all_of(int descriptor) {
    std::string text;
    std::array<char, 4096> some{};
    for (;;) {
        const ssize_t got = ::read(descriptor, some.data(), some.size());
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return text;
        text.append(some.data(), static_cast<std::size_t>(got));
    }
}

[[noreturn]] void fail_damaged(const std::filesystem::path& path, const std::string& how) {
    throw InputError(
        fmt::format("{}: is damaged: {}; take another copy, or have h5dump show what is left", printable(path), how));
}

/// Throws what the trial has come to, unless all was well.
void judge(const Trial& of, int status, const std::string& reported) {
    const bool ended = WIFEXITED(status) && WEXITSTATUS(status) == 0 && !reported.empty();
    if (!ended) {
        const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
        if (signal == SIGALRM || signal == SIGXCPU) {
            fail_damaged(
                of.path,
                fmt::format("reading it takes more than {} s of the processor, which its size of {:.3g} MB does not "
                            "explain",
                            of.seconds, of.file_bytes * 1e-6));
        }
        fail_damaged(of.path, "the library that reads it does not get through it");
    }
    const std::string message = reported.substr(1);
    switch (static_cast<Ending>(reported.front())) {
        case Ending::fine:
            return;
        case Ending::input:
            throw InputError(message);
        case Ending::run:
            throw RunError(message);
        case Ending::memory:
            fail_damaged(of.path, "it asks for more memory than what it holds can need");
        case Ending::other:
            break;
    }
    fail_damaged(of.path, printable(message));
}

}  // namespace

void try_reading(const std::filesystem::path& path, Links links, const std::function<void(const GuardedPath&)>& read) {
    if (trial) return read(GuardedPath(path));
    if (is_without_trial()) return;
    std::error_code unreachable;
    const auto status = std::filesystem::status(path, unreachable);
    if (!std::filesystem::exists(status)) {
        throw InputError(fmt::format("{}: {}", printable(path), unreachable.message()));
    }
    if (!std::filesystem::is_regular_file(status)) throw InputError(fmt::format("{}: is not a file", printable(path)));
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) {
        throw RunError(fmt::format("{}: cannot be read: {}", printable(path), system_text(errno)));
    }
    const Descriptor from(ends[0]);
    Descriptor to(ends[1]);
    const double file_bytes = size_of_file(path);
    const Trial what{path, links, file_bytes, patience_s(file_bytes, links), to.get()};
    const pid_t child = detail::fork_with_library();
    if (child == 0) {
        be_the_trial(what, [&] {
            const LinksInForce set(links);
            read(GuardedPath(path));
        });
    }
    if (child < 0) throw RunError(fmt::format("{}: cannot be read: {}", printable(path), system_text(errno)));
    to = Descriptor();
    const int ended = wait_for_child(child);
    check_interrupt();  // Ctrl-C reaches the trial, too
    const std::string reported = all_of(from.get());
    if (ended == -1) {  // somebody else waits for our children: what it reported is all that is known
        if (reported.empty()) fail_damaged(path, "the library that reads it does not get through it");
        return judge(what, 0, reported);
    }
    judge(what, ended, reported);
}

LinksInForce::LinksInForce(Links links) : before_(in_force) { in_force = links; }
LinksInForce::~LinksInForce() { in_force = before_; }
Links links_in_force() { return in_force; }

bool is_trial() { return trial; }
void note_left_out() { left_out = left_out || trial; }

void expect_memory(double bytes) {
    if (memory_limit_bytes == 0.0) return;
    memory_limit_bytes += bytes;
    set_memory_limit();
}

}  // namespace ringlock::store
