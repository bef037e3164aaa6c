#include "engine/core/interrupt.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdint>
#include <cstring>
#include <deque>
#include <iterator>
#include <mutex>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/core/stop.hpp"

namespace ringlock {
namespace {

constexpr int clock_signal = SIGALRM;
constexpr int watched[] = {SIGINT, SIGTERM, SIGHUP, clock_signal};

/// Time that the program has to end by itself, and from one look at a HoldEnd to the next.
constexpr long patience_ns = 800'000'000;
constexpr long hold_ns = 10'000'000;

std::atomic<bool> stop_requested{false};
std::atomic<int> signal_number{SIGINT};
std::atomic<int> wake_descriptor{-1};
std::atomic<int> holds{0};
std::atomic<bool> has_clock{false};
timer_t end_clock;

constexpr const char* nothing_written = "ringlock: interrupted, nothing written\n";
/// Points to text that stays as it is to the end of the process: the handler may read it at any moment.
std::atomic<const char*> farewell_text{nothing_written};
std::mutex written_mutex;
std::vector<std::string> written;       // since the guard was made
std::deque<std::string> all_farewells;  // a deque does not move its elements

/// A path in static storage, so that the handler never reads freed memory.
struct Slot {
    std::atomic<bool> armed{false};
    bool taken = false;  // under slots_mutex
    char path[PATH_MAX] = {};
};

constexpr std::size_t no_slot = 16;
std::array<Slot, no_slot> slots;
std::mutex slots_mutex;

static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
                  std::atomic<const char*>::is_always_lock_free,
              "a signal handler may only touch lock-free atomics");

// The code below runs in signal handlers and uses only functions that are safe there.

void set_clock(long nanoseconds) {
    if (!has_clock) return;
    itimerspec when = {};
    when.it_value.tv_nsec = nanoseconds;
    timer_settime(end_clock, 0, &when, nullptr);
}

void end_by(int number) {
    for (Slot& slot : slots)
        if (slot.armed.load()) unlink(slot.path);
    // Not into a pipe that is full: it would wait.
    pollfd out{STDERR_FILENO, POLLOUT, 0};
    const char* const text = farewell_text;
    if (poll(&out, 1, 0) == 1 && write(STDERR_FILENO, text, std::strlen(text)) < 0) errno = 0;
    // A signal is blocked while its own handler runs: then it strikes, with its default action, on the way out.
    signal(number, SIG_DFL);
    raise(number);
}

extern "C" void on_signal(int number) {
    const int saved = errno;
    const bool first = !stop_requested.exchange(true);
    signal_number = number;
    if (first) {
        const std::uint64_t one = 1;
        if (write(wake_descriptor, &one, sizeof one) < 0) errno = 0;
        set_clock(patience_ns);
    } else if (holds > 0) {
        set_clock(hold_ns);
    } else {
        end_by(number);
    }
    errno = saved;
}

extern "C" void on_clock(int) {
    const int saved = errno;
    if (holds > 0) {
        set_clock(hold_ns);
    } else {
        end_by(signal_number);
    }
    errno = saved;
}

}  // namespace

bool interrupted() { return stop_requested.load(std::memory_order_relaxed); }

void check_interrupt() {
    if (interrupted()) throw Interrupted();
}

int interrupt_signal() { return signal_number; }

int interrupt_descriptor() { return wake_descriptor; }

std::string_view farewell() { return farewell_text.load(); }

void note_written(const std::filesystem::path& path) {
    const std::lock_guard lock(written_mutex);
    written.push_back(path.string());
    std::string names;
    for (const std::string& name : written) names += (names.empty() ? "" : ", ") + name;
    farewell_text =
        all_farewells.emplace_back(fmt::format("ringlock: interrupted; these files were complete before: {}\n", names))
            .c_str();
}

InterruptGuard::InterruptGuard() {
    static_assert(std::size(watched) == signals_);
    stop_requested = false;
    {
        const std::lock_guard lock(written_mutex);
        written.clear();
        farewell_text = nothing_written;
    }
    wake_descriptor = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    sigevent event = {};
    event.sigev_notify = SIGEV_SIGNAL;
    event.sigev_signo = clock_signal;
    has_clock = timer_create(CLOCK_MONOTONIC, &event, &end_clock) == 0;
    for (std::size_t i = 0; i < signals_; ++i) {
        struct sigaction action = {};
        action.sa_handler = watched[i] == clock_signal ? on_clock : on_signal;
        action.sa_flags = SA_RESTART;
        sigemptyset(&action.sa_mask);
        sigaction(watched[i], nullptr, &before_[i]);
        const bool stays_ignored = watched[i] == SIGHUP && before_[i].sa_handler == SIG_IGN;
        if (!stays_ignored) sigaction(watched[i], &action, nullptr);
    }
}

InterruptGuard::~InterruptGuard() {
    if (has_clock.exchange(false)) timer_delete(end_clock);
    signal(clock_signal, SIG_IGN);  // discards a pending one
    for (std::size_t i = 0; i < signals_; ++i) sigaction(watched[i], &before_[i], nullptr);
    const int descriptor = wake_descriptor.exchange(-1);
    if (descriptor >= 0) close(descriptor);
    stop_requested = false;
}

StopByRequest::StopByRequest() { stop_requested = false; }

StopByRequest::~StopByRequest() { stop_requested = false; }

void StopByRequest::request() { stop_requested = true; }

HoldEnd::HoldEnd() { ++holds; }

HoldEnd::~HoldEnd() { --holds; }

RemoveOnKill::RemoveOnKill(const std::string& absolute_path) : slot_(no_slot) {
    if (absolute_path.size() >= PATH_MAX) return;
    const std::lock_guard lock(slots_mutex);
    for (std::size_t i = 0; i < slots.size(); ++i) {
        if (slots[i].taken) continue;
        slots[i].taken = true;
        std::memcpy(slots[i].path, absolute_path.c_str(), absolute_path.size() + 1);
        slots[i].armed = true;
        slot_ = i;
        return;
    }
}

RemoveOnKill::~RemoveOnKill() {
    if (slot_ == no_slot) return;
    const std::lock_guard lock(slots_mutex);
    slots[slot_].armed = false;
    slots[slot_].taken = false;
}

}  // namespace ringlock
