#include "engine/core/interrupt.hpp"

#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstring>
#include <mutex>

#include "engine/core/error.hpp"

namespace ringlock {
namespace {

constexpr int watched[] = {SIGINT, SIGTERM, SIGHUP};

std::atomic<bool> stop_requested{false};
std::atomic<int> signal_number{SIGINT};

/// A path in static storage, so that the handler never meets freed memory.
struct Slot {
    std::atomic<bool> armed{false};
    bool taken = false;  // under slots_mutex
    char path[PATH_MAX] = {};
};

constexpr std::size_t no_slot = 16;
std::array<Slot, no_slot> slots;
std::mutex slots_mutex;

static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free,
              "a signal handler may only touch lock-free atomics");

extern "C" void on_signal(int number) {
    signal_number = number;
    if (!stop_requested.exchange(true)) return;
    const int saved = errno;
    for (Slot& slot : slots)
        if (slot.armed.load()) unlink(slot.path);
    errno = saved;
    // The signal is blocked while its handler runs: it strikes, with its default action, on the way out.
    signal(number, SIG_DFL);
    raise(number);
}

}  // namespace

bool interrupted() { return stop_requested.load(std::memory_order_relaxed); }

void check_interrupt() {
    if (interrupted()) throw Interrupted();
}

int interrupt_signal() { return signal_number; }

InterruptGuard::InterruptGuard() {
    static_assert(std::size(watched) == signals_);
    stop_requested = false;
    struct sigaction action = {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    sigemptyset(&action.sa_mask);
    for (std::size_t i = 0; i < signals_; ++i) {
        sigaction(watched[i], nullptr, &before_[i]);
        const bool stays_ignored = watched[i] == SIGHUP && before_[i].sa_handler == SIG_IGN;
        if (!stays_ignored) sigaction(watched[i], &action, nullptr);
    }
}

InterruptGuard::~InterruptGuard() {
    for (std::size_t i = 0; i < signals_; ++i) sigaction(watched[i], &before_[i], nullptr);
    stop_requested = false;
}

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
