#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace ringlock::parts {

/// How far a run is, for other processes to read.
struct Status {
    std::string process;        ///< "process 123 on host since ..."
    std::string time_utc;       ///< when this was true
    double elapsed_s = 0.0;     ///< of this process
    std::int64_t gyros = 0;     ///< finished, those of earlier processes included
    std::int64_t of_gyros = 0;  ///< that will be
    double turns_per_s = 0.0;   ///< of this process
    std::optional<double> left_s;
    std::string last_block;  ///< "gyros 16 to 31 at 2026-01-01T00:00:00Z"; empty where none is finished yet
};

/// Puts text in the place of a file of a folder, so that nobody reads half of it. Not brought to the disk: after a
/// crash of the machine it is worth nothing. Throws RunError.
void replace_text(const std::filesystem::path& file, const std::string& text);

/// Writes it for read_status(). Fails silently: a run goes on without.
void write_status(const std::filesystem::path& folder, const Status& status);

/// Nothing where there is none, or none that can be read.
std::optional<Status> read_status(const std::filesystem::path& folder);

}  // namespace ringlock::parts
