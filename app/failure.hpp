#pragma once
#include <exception>
#include <functional>
#include <string>

namespace ringlock::app {

inline constexpr int done = 0;
inline constexpr int run_failed = 1;
inline constexpr int input_wrong = 2;
inline constexpr int ended_by_signal = 128;  ///< and more: the number of the signal on top

/// Ends a command with a status and no message: another process has printed the reason.
struct EndQuietly {
    int status = run_failed;
};

/// Calls `work`, which uses values of a file. An exception of a library, which does not know the file, becomes an
/// InputError that names the file: one of its values is beyond the range that can be evaluated. A lack of memory or of
/// another resource of the system becomes a RunError that names it.
void name_file_of_failure(const std::string& file, const std::function<void()>& work);

/// Evaluates values of a file. An InputError of the evaluation, which does not know the file, names it afterwards.
void name_file_of_values(const std::string& file, const std::function<void()>& evaluate);

/// Writes the failure to standard error and returns the exit status for it.
int tell_failure(const std::exception_ptr& failure);

}  // namespace ringlock::app
