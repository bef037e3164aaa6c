#pragma once
#include <csignal>
#include <cstddef>
#include <string>

/// Ctrl-C and its relatives: a run stops where it can do so cleanly and leaves nothing half-written.
namespace ringlock {

/// True from the first SIGINT, SIGTERM or SIGHUP on that came while an InterruptGuard stood. Cheap; from any thread.
bool interrupted();

/// Throws Interrupted where interrupted() holds.
void check_interrupt();

/// The signal that interrupted() is about, also after the guard is gone; SIGINT where there was none.
int interrupt_signal();

/// Turns SIGINT, SIGTERM and SIGHUP into a flag for as long as it lives; the handlers it found return on destruction.
///
/// The first signal only sets the flag. The second ends the process at once, by that signal, after removing the
/// files announced by RemoveOnKill. SIGHUP stays ignored where it was (nohup). One guard at a time, made in main().
class InterruptGuard {
   public:
    InterruptGuard();
    ~InterruptGuard();
    InterruptGuard(const InterruptGuard&) = delete;
    InterruptGuard& operator=(const InterruptGuard&) = delete;

   private:
    static constexpr std::size_t signals_ = 3;
    struct sigaction before_[signals_] = {};
};

/// Announces a file that the signal handler removes before it ends the process. Up to 16 at a time; more are not
/// announced, and nor is a path longer than PATH_MAX: then a process that is killed leaves the file behind.
class RemoveOnKill {
   public:
    /// `absolute_path` must not depend on the working directory.
    explicit RemoveOnKill(const std::string& absolute_path);
    ~RemoveOnKill();
    RemoveOnKill(const RemoveOnKill&) = delete;
    RemoveOnKill& operator=(const RemoveOnKill&) = delete;

   private:
    std::size_t slot_;
};

}  // namespace ringlock
