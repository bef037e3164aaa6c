#include "tests/fuzz/fuzz.hpp"

#include <execinfo.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <new>
#include <optional>
#include <stdexcept>

#include "engine/core/error.hpp"
#include "engine/core/notice.hpp"
#include "engine/store/without_trial.hpp"

// Module and place are enough to say whose code a fault is in; looking up names takes seconds each time. Libraries ask
// for absurd amounts of memory on damaged files, and leak where they refuse one.
extern "C" const char* __asan_default_options() {
    return "allocator_may_return_null=1:max_allocation_size_mb=2000:symbolize=0:detect_leaks=0:handle_abort=1:"
           "malloc_context_size=3:quarantine_size_mb=8";
}

namespace ringlock::fuzz {
namespace {

/// What the processes share.
struct Shared {
    std::uint64_t at = 0;  ///< number of the input that is being read
    Tally tally;
};

Shared& shared() {
    static Shared* const memory =
        static_cast<Shared*>(mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
    return *memory;
}

constexpr std::uint64_t inputs_of_a_process = 5000;
constexpr int most_s = 1;  // of the processor, for one input
constexpr int looped = 86;

std::filesystem::path folder_in_memory() {
    const std::filesystem::path memory = "/dev/shm";
    return access(memory.c_str(), W_OK | X_OK) == 0 ? memory : std::filesystem::temp_directory_path();
}

/// Says in which modules the process is, as a report of a sanitizer does.
void tell_stack(int signal) {
    std::array<void*, 64> frames{};
    const int count = backtrace(frames.data(), static_cast<int>(frames.size()));
    // Without this function and, under a sanitizer, its backtrace(): the frames begin where the handler returns to.
    const auto end = frames.begin() + count;
    const auto found = std::find(frames.begin(), end, __builtin_return_address(0));
    const auto from = found == end ? frames.begin() : found;
    backtrace_symbols_fd(&*from, static_cast<int>(end - from), STDERR_FILENO);
    _exit(signal == SIGPROF ? looped : 128 + signal);
}

void watch(int signal) {
    // On a stack of its own, for a recursion without end leaves no other.
    static std::vector<char> memory(std::size_t{1} << 17U);
    stack_t stack{};
    stack.ss_sp = memory.data();
    stack.ss_size = memory.size();
    sigaltstack(&stack, nullptr);
    struct sigaction action {};
    action.sa_flags = SA_ONSTACK;
    action.sa_handler = tell_stack;
    sigaction(signal, &action, nullptr);
}

/// Whether the first frame of a report that is of neither the C library nor a sanitizer is in one of the libraries.
bool is_in(const std::vector<std::string>& libraries, const std::string& report) {
    std::string_view rest = report;
    while (!rest.empty()) {
        const std::string_view line = rest.substr(0, rest.find('\n'));
        rest.remove_prefix(std::min(rest.size(), line.size() + 1));
        const bool is_frame = line.find("+0x") != std::string_view::npos && line.find('(') != std::string_view::npos;
        if (!is_frame) continue;
        const std::array<std::string_view, 7> of_system = {"libasan",   "libubsan", "libc.so",   "libm.so",
                                                           "libstdc++", "libgcc",   "linux-vdso"};
        const auto has = [&](std::string_view name) { return line.find(name) != std::string_view::npos; };
        if (std::any_of(of_system.begin(), of_system.end(), has)) continue;
        return std::any_of(libraries.begin(), libraries.end(), has);
    }
    return false;
}

std::uint64_t seed_of(std::uint64_t seed, std::uint64_t number) {
    std::seed_seq mix{seed & 0xffffffffU, seed >> 32U, number & 0xffffffffU, number >> 32U};
    std::array<std::uint32_t, 2> words{};
    mix.generate(words.begin(), words.end());
    return (std::uint64_t{words[0]} << 32U) | words[1];
}

[[noreturn]] void work(const Search& search, std::uint64_t seed, std::uint64_t first, std::uint64_t last,
                       const std::string& report) {
    const int to = open(report.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (to >= 0) dup2(to, STDERR_FILENO);
    std::array<void*, 4> frames{};
    backtrace(frames.data(), static_cast<int>(frames.size()));  // loads what it needs while the heap is whole
    watch(SIGPROF);
#ifndef __SANITIZE_ADDRESS__
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) watch(signal);
#endif
    std::optional<store::WithoutTrial> in_this_process;
    in_this_process.emplace();
    InputFile file;
    for (std::uint64_t number = first; number < last; ++number) {
        shared().at = number;
        const itimerval patience{{0, 0}, {most_s, 0}};
        setitimer(ITIMER_PROF, &patience, nullptr);
        Chance chance(seed_of(seed, number));
        search.one(chance, file, shared().tally);
    }
    _exit(0);
}

void cut(std::string& bytes, std::size_t at, std::size_t length) { bytes.erase(std::min(at, bytes.size()), length); }

/// A number that lengths, counts and addresses do not expect.
std::uint64_t odd_number(Chance& chance, std::size_t size) {
    const std::vector<std::uint64_t> numbers = {0,
                                                1,
                                                2,
                                                7,
                                                8,
                                                255,
                                                256,
                                                4096,
                                                0x7fffffff,
                                                0x80000000,
                                                0xffffffff,
                                                std::uint64_t{1} << 32U,
                                                std::uint64_t{1} << 40U,
                                                std::uint64_t{1} << 63U,
                                                ~std::uint64_t{0},
                                                ~std::uint64_t{0} - 7,
                                                size,
                                                size - 1,
                                                size + 1};
    return chance.of(numbers);
}

}  // namespace

std::string damaged(std::string bytes, std::size_t faults, Chance& chance) {
    for (; faults > 0; --faults) {
        const std::size_t at = chance.any(bytes.size());
        const std::size_t length = std::min<std::size_t>(1 + chance.any(16), bytes.size() - std::min(at, bytes.size()));
        switch (chance.any(10)) {
            case 0:
                cut(bytes, at, length);
                break;
            case 1:
                bytes.insert(at, bytes.substr(at, length * 4));
                break;
            case 2:
                bytes.resize(at);
                break;
            case 3:
                std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), length, '\0');
                break;
            case 4:
            case 5:
            case 6: {
                const std::uint64_t number = odd_number(chance, bytes.size());
                const std::size_t width = std::size_t{1} << chance.any(4);
                const std::size_t place = chance.one_in(3) ? at : at / 4 * 4;
                if (place + width <= bytes.size()) std::memcpy(&bytes[place], &number, width);
                break;
            }
            case 7:
                if (at < bytes.size()) bytes[at] = static_cast<char>(chance.any(256));
                break;
            default:
                if (at < bytes.size()) bytes[at] = static_cast<char>(bytes[at] ^ (1 << chance.any(8)));
                break;
        }
    }
    return bytes;
}

InputFile::InputFile() : path_((folder_in_memory() / fmt::format("ringlock-fuzz-{}", ::getpid())).string()) {
    descriptor_ = open(path_.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (descriptor_ < 0) throw RunError(fmt::format("{}: cannot be made", path_));
}

InputFile::~InputFile() {
    close(descriptor_);
    std::error_code stays;
    std::filesystem::remove(path_, stays);
}

void InputFile::write(std::string_view bytes) {
    const bool done = ftruncate(descriptor_, 0) == 0 &&
                      pwrite(descriptor_, bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size());
    if (!done) throw RunError(fmt::format("{}: cannot be written", path_));
}

void attempt(const std::string& path, const std::function<void()>& read, Tally& tally) {
    const auto fail = [](std::string_view why, std::string_view message) {
        fmt::print(stderr, "{}: {}\n", why, message);
        std::fflush(stderr);
        _exit(1);
    };
    ++tally.reads;
    try {
        read();
        ++tally.read;
    } catch (const InputError& error) {
        ++tally.refused;
        const std::string_view message = error.what();
        if (message.find(path) == std::string_view::npos) fail("the message does not name the file", message);
        const auto is_control = [](char c) { return (c >= 0 && c < 0x20 && c != '\n' && c != '\t') || c == 0x7f; };
        if (std::any_of(message.begin(), message.end(), is_control)) fail("control characters in a message", message);
    } catch (const std::bad_alloc&) {
        ++tally.guarded;
    } catch (const std::length_error&) {
        ++tally.guarded;
    } catch (const std::exception& error) {
        fail("no InputError", error.what());
    }
}

int run(const Search& search, const std::vector<std::string>& arguments) {
    if (arguments.size() < 2 || arguments.size() > 3) {
        fmt::print(stderr, "usage: {} SEED COUNT [FIRST]\n", search.name);
        return 2;
    }
    const auto number = [&](std::size_t i) {
        return arguments.size() > i ? std::strtoull(arguments[i].c_str(), nullptr, 10) : 0;
    };
    shared() = {};  // before there is another process
    const std::uint64_t seed = number(0);
    const std::uint64_t first = number(2);
    const std::uint64_t last = first + number(1);
    set_notice_sink([](std::string_view) {});
    const std::string report = (folder_in_memory() / fmt::format("ringlock-fuzz-{}.report", ::getpid())).string();
    std::uint64_t faults = 0;
    for (std::uint64_t next = first; next < last;) {
        const std::uint64_t end = std::min(last, next + inputs_of_a_process);
        const pid_t worker = fork();
        if (worker < 0) throw RunError("no process can be started");
        if (worker == 0) work(search, seed, next, end, report);
        int status = 0;
        waitpid(worker, &status, 0);
        std::error_code stays;
        std::filesystem::remove(folder_in_memory() / fmt::format("ringlock-fuzz-{}", worker), stays);
        next = end;
        if (WIFEXITED(status) && WEXITSTATUS(status) == 0) continue;
        next = shared().at + 1;
        std::ifstream in(report, std::ios::binary);
        const std::string said{std::istreambuf_iterator<char>(in), {}};
        if (is_in(search.guarded_libraries, said)) {
            ++shared().tally.of_library;
            continue;
        }
        ++faults;
        fmt::print(stderr, "input {}: status {:#x}; once more: {} {} 1 {}\n{}\n", shared().at, status, search.name,
                   seed, shared().at, said);
    }
    std::error_code stays;
    std::filesystem::remove(report, stays);
    const Tally& tally = shared().tally;
    fmt::print("{}: {} inputs, {} reads: {} read, {} refused, {} out of memory, {} ended in a library; {} faults\n",
               search.name, last - first, tally.reads, tally.read, tally.refused, tally.guarded, tally.of_library,
               faults);
    return faults == 0 && tally.read > 0 ? 0 : 1;
}

}  // namespace ringlock::fuzz
