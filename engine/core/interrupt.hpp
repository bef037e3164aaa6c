#pragma once
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

/// Ctrl-C and its relatives: a run stops where it can do so cleanly and leaves nothing half-written.
namespace ringlock {

/// True from the first SIGINT, SIGTERM or SIGHUP on that came while an InterruptGuard stood. Cheap; from any thread.
bool interrupted();

/// Throws Interrupted where interrupted() holds.
void check_interrupt();

/// The signal that interrupted() reports, also after the end of the guard; SIGINT if no signal has arrived.
int interrupt_signal();

/// A descriptor that poll() finds readable from the first signal on; -1 while no InterruptGuard stands.
int interrupt_descriptor();

/// The line that reports the interruption: that nothing was written, or the names of the written files
/// (note_written()).
std::string_view farewell();

/// Announces a file that is whole and has its name, for farewell().
void note_written(const std::filesystem::path& path);

/// Turns SIGINT, SIGTERM and SIGHUP into a flag for as long as it lives; the handlers it found return on destruction.
///
/// The first signal sets the flag and leaves the program 0.8 s to end by itself. Code that does not check the flag for
/// so long (a system call that waits, hours within a library) is not waited for: after that time, or at the second
/// signal, the process writes farewell(), removes the files announced by RemoveOnKill and ends by the first or the
/// second signal. SIGHUP stays ignored where it was (nohup). One guard at a time, made in main().
class InterruptGuard {
   public:
    InterruptGuard();
    ~InterruptGuard();
    InterruptGuard(const InterruptGuard&) = delete;
    InterruptGuard& operator=(const InterruptGuard&) = delete;

   private:
    static constexpr std::size_t signals_ = 4;  // the fourth is that of the clock
    struct sigaction before_[signals_] = {};
};

/// While one lives, no signal ends the process: for steps that belong together and take a negligible time.
class HoldEnd {
   public:
    HoldEnd();
    ~HoldEnd();
    HoldEnd(const HoldEnd&) = delete;
    HoldEnd& operator=(const HoldEnd&) = delete;
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
