#pragma once
#include <filesystem>
#include <string>

namespace ringlock::report {

/// Runs gnuplot on a script whose figure goes to standard output, and puts that into a file, complete or not at all.
///
/// Settings of the user (~/.gnuplot) are not read. Throws RunError when gnuplot is missing or fails (with what it said)
/// or the file cannot be written.
void run_gnuplot(const std::string& script, const std::filesystem::path& output);

}  // namespace ringlock::report
