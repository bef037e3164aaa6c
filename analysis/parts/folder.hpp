#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/parts/manifest.hpp"

namespace ringlock::parts {

/// Receives the messages to people while a run goes on: a line without its end.
using Tell = std::function<void(const std::string& line)>;

/// Treatment of finished gyros of an earlier run that are found.
enum class Beginning { refuse, resume, discard };

/// The folder next to an output in which its run keeps finished gyros: OUTPUT.parts. It belongs to one process at a
/// time, by a lock that the system releases when the process ends, for any reason; the lock therefore guards the output
/// as well.
///
/// It is removed when its run is complete, or when it holds no finished gyros.
class Folder {
   public:
    /// Makes the folder or takes over the one that an interrupted run has left.
    ///
    /// Throws InputError where another process holds it (host and process are named), where it holds finished gyros
    /// and `beginning` is Beginning::refuse, where they are of another run (the differences are listed), and where the
    /// folder of that name is not of a run.
    Folder(const std::filesystem::path& output, const Manifest& manifest, Beginning beginning, const Tell& tell);
    ~Folder();
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;

    const std::filesystem::path& path() const { return path_; }
    const Manifest& manifest() const { return manifest_; }
    /// "process 123 on host since 2026-01-01T00:00:00Z": this one.
    const std::string& who() const { return who_; }

    /// Files of finished gyros, sorted by name.
    std::vector<std::filesystem::path> files() const;

    /// The run is complete: removes all of it. Files that are not of a run stay, and the folder with them.
    void remove();

   private:
    void lock_or_refuse();
    void clear(const Tell& tell) const;
    bool has_finished() const;

    std::filesystem::path output_;
    std::filesystem::path path_;
    Manifest manifest_;
    std::string who_;
    int lock_fd_ = -1;
};

/// Name of the folder of an output; a symbolic link is followed.
std::filesystem::path folder_of(const std::filesystem::path& output);

/// Name of the file of a shard of the output.
std::filesystem::path shard_file(const std::filesystem::path& output, const Shard& shard);

/// Shards of the output of which there is a file, sorted by number.
std::vector<std::filesystem::path> shard_files(const std::filesystem::path& output);

/// Shards of the output of which there is a file or a folder, sorted.
std::vector<Shard> shards_begun(const std::filesystem::path& output);

/// Names within a folder.
inline constexpr std::string_view part_suffix = ".part";        ///< of files of finished gyros
inline constexpr std::string_view partial_suffix = ".partial";  ///< of those that are being written
inline constexpr std::string_view status_name = "status.json";
inline constexpr std::string_view manifest_name = "run.json";

/// Files of finished gyros in a folder, sorted by name; none where there is no such folder.
std::vector<std::filesystem::path> part_files(const std::filesystem::path& folder);

/// Process that holds a folder now: "process 123 on host", or empty if no process holds it.
std::string holder(const std::filesystem::path& folder);

}  // namespace ringlock::parts
