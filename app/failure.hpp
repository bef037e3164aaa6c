#pragma once
#include <exception>

namespace ringlock::app {

inline constexpr int done = 0;
inline constexpr int run_failed = 1;
inline constexpr int input_wrong = 2;
inline constexpr int ended_by_signal = 128;  ///< and more: the number of the signal on top

/// Ends a command with a status and no message: another process has told why.
struct EndQuietly {
    int status = run_failed;
};

/// Tells on standard error what went wrong, and returns the exit status for it.
int tell_failure(const std::exception_ptr& failure);

}  // namespace ringlock::app
