#pragma once
#include <sys/types.h>
#include <time.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "engine/core/interrupt.hpp"
#include "engine/core/waiting.hpp"

namespace ringlock {

/// Where a symbolic link leads, also if nothing is there yet. A circle of links comes back as one of its links.
std::filesystem::path follow_links(const std::filesystem::path& path);

/// A file that appears whole or not at all.
///
/// Write to partial(), a separate file next to the target; commit() brings it to the disk and gives it the target's
/// name. A file that had the name at the claim is replaced, its mode and, where permitted, its owner are kept. A file
/// that another process has made or changed since then is not replaced. Destroyed without commit(), it leaves nothing.
class AtomicPath {
   public:
    /// Claims the partial file, and removes those that killed runs on this machine have left of the same target (each
    /// with a notice()). A target that is a symbolic link is followed.
    /// Throws InputError where the target cannot be written: its directory is missing or not writable, or the target
    /// is there and no regular file.
    explicit AtomicPath(const std::filesystem::path& target);
    ~AtomicPath();
    AtomicPath(const AtomicPath&) = delete;
    AtomicPath& operator=(const AtomicPath&) = delete;

    const std::filesystem::path& partial() const { return partial_; }
    const std::filesystem::path& target() const { return target_; }
    /// The partial file, open for reading and writing.
    int descriptor() const { return descriptor_.get(); }

    /// Throws RunError where the disk refuses; the partial file is then removed by the destructor. Throws RunError,
    /// too, where another process has made or changed the target since the claim: then that file is kept, and this one
    /// next to it under a name that the message gives. Throws Interrupted where the user asks to stop while it waits
    /// for the disk.
    void commit();

   private:
    /// Data that distinguish a file from another one, or from an earlier state of itself.
    struct Identity {
        dev_t device;
        ino_t inode;
        off_t size;
        std::int64_t modified_s, modified_ns;
        bool operator==(const Identity&) const = default;
    };
    static std::optional<Identity> identity_of(const std::filesystem::path& path);

    bool has_partial() const;
    void keep_owner_and_mode() const;
    void give_name();
    void give_new_name();
    void replace_found();
    std::filesystem::path move_to_free_path();
    void settled();
    [[noreturn]] void refuse_to_replace(std::string_view what_happened);

    std::filesystem::path target_;
    std::filesystem::path partial_;
    std::optional<Identity> found_;  ///< the target at the claim
    Descriptor descriptor_;
    std::optional<RemoveOnKill> remove_on_kill_;
    bool settled_ = false;  ///< the partial file has gone
};

/// Writes a text file, whole or not at all. Throws InputError where the file cannot be created, RunError where the disk
/// refuses or another process changes it meanwhile.
void write_text(const std::filesystem::path& path, std::string_view text);
/// The same for a file that is claimed already.
void write_text(AtomicPath& target, std::string_view text);

}  // namespace ringlock
