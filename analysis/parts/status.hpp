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

/// Replaces a file of a folder by a text as a whole, so that no reader sees a part of it. The text is not synced to the
/// disk: after a crash of the machine it may be lost. Throws RunError.
void replace_text(const std::filesystem::path& file, const std::string& text);

/// Writes it for read_status(). Failures are ignored: a run goes on without the status.
void write_status(const std::filesystem::path& folder, const Status& status);

/// Nothing where there is no status file, or an unreadable one.
std::optional<Status> read_status(const std::filesystem::path& folder);

}  // namespace ringlock::parts
