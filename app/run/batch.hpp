#pragma once
#include <span>

#include "app/run/run_one.hpp"

namespace ringlock::app {

/// Whether `run` is given several scenarios, or a folder for the results.
bool is_batch(const RunArguments& arguments);

/// Runs scenarios one after the other, each with all threads. One that fails does not stop the others; those that are
/// finished are left out, and those that were interrupted go on. Writes batch.json next to the results after each, and
/// prints a table at the end.
///
/// Throws InputError where the command line is wrong (nothing is run then), RunError at the end where any scenario
/// failed, and Interrupted.
void run_batch(const RunArguments& arguments, std::span<const char* const> command_line);

}  // namespace ringlock::app
