#pragma once
#include <filesystem>
#include <optional>
#include <string_view>

#include "engine/core/interrupt.hpp"

namespace ringlock {

/// The file that an output's name means: absolute, and where a symbolic link leads. Throws InputError where there is
/// something that cannot be replaced by a file.
std::filesystem::path resolved_target(const std::filesystem::path& target);

/// A file that appears whole or not at all.
///
/// Write to partial(), a file of its own beside the target; commit() brings it to the disk and gives it the target's
/// name, replacing a file that had it. Destroyed without commit(), it leaves nothing.
class AtomicPath {
   public:
    /// Claims the partial file. A target that is a symbolic link is followed.
    /// Throws InputError where the target cannot be written: its directory is missing or not writable, or the target
    /// is there and no regular file.
    explicit AtomicPath(const std::filesystem::path& target);
    ~AtomicPath();
    AtomicPath(const AtomicPath&) = delete;
    AtomicPath& operator=(const AtomicPath&) = delete;

    const std::filesystem::path& partial() const { return partial_; }
    const std::filesystem::path& target() const { return target_; }

    /// Throws RunError where the disk refuses; the partial file is then removed by the destructor.
    void commit();

   private:
    std::filesystem::path target_;
    std::filesystem::path partial_;
    std::optional<RemoveOnKill> remove_on_kill_;
    bool committed_ = false;
};

/// Writes a text file, whole or not at all. Throws InputError where it cannot be there, RunError where the disk
/// refuses.
void write_text(const std::filesystem::path& path, std::string_view text);

}  // namespace ringlock
