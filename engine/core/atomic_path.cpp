#include "engine/core/atomic_path.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <climits>
#include <csignal>
#include <system_error>

#include "engine/core/error.hpp"
#include "engine/core/notice.hpp"
#include "engine/core/printable.hpp"

namespace ringlock {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view partial_end = ".partial";

std::string reason(int error) { return std::generic_category().message(error); }

fs::path resolve(const fs::path& target) {
    if (target.empty()) throw InputError("the name of the output file is empty; give one");
    const fs::path resolved = follow_links(fs::absolute(target));
    std::error_code error;
    const fs::file_status status = fs::status(resolved, error);
    if (fs::is_directory(status))
        throw InputError(fmt::format("cannot write {}: it is a directory; name a file in it", printable(target)));
    if (fs::exists(status) && !fs::is_regular_file(status))
        throw InputError(
            fmt::format("cannot write {}: it exists and is not a regular file; name another file", printable(target)));
    return resolved;
}

[[noreturn]] void refuse(const fs::path& target, int error) {
    const std::string directory = target.parent_path().string();
    std::string what_to_do = "name a directory that can be written";
    if (error == ENOENT) what_to_do = "create it first (mkdir -p) or name another";
    if (error == ENAMETOOLONG) what_to_do = "choose a shorter name";
    throw InputError(
        fmt::format("cannot write {}: directory {}: {}; {}", printable(target), directory, reason(error), what_to_do));
}

/// Name of this machine in the names of partial files.
std::string host() {
    constexpr std::size_t longest = 40;
    std::array<char, HOST_NAME_MAX + 1> name{};
    gethostname(name.data(), name.size() - 1);
    std::string text = std::string(name.data()).substr(0, longest);
    for (char& c : text) {
        if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '.') c = '_';
    }
    return text;
}

/// A lock that ends with the process. It is valid across containers, in which process numbers differ. File systems
/// without locks are accepted.
bool lock_for_life(int descriptor) {
    struct flock whole = {};
    whole.l_type = F_WRLCK;
    whole.l_whence = SEEK_SET;
    return fcntl(descriptor, F_OFD_SETLK, &whole) == 0 || (errno != EAGAIN && errno != EACCES);
}

/// Creates a file that did not exist, next to the target. Others must not read it if they may not read the file that it
/// replaces, which is not known before the end.
Descriptor claim(const fs::path& target, bool replaces, fs::path& partial) {
    const std::string name = host();
    for (int attempt = 0;; ++attempt) {
        partial = fmt::format("{}.{}-{}@{}{}", target.string(), getpid(), attempt, name, partial_end);
        Descriptor made(
            open(partial.c_str(), O_CREAT | O_EXCL | O_NOFOLLOW | O_RDWR | O_CLOEXEC, replaces ? 0600 : 0666));
        if (made.valid()) {
            lock_for_life(made.get());
            return made;
        }
        if (errno != EEXIST) refuse(target, errno);
    }
}

/// The process that a partial file of the target is of, by the file's name; 0 where it is no such file of this machine.
pid_t writer_of(std::string_view name, std::string_view target, std::string_view this_host) {
    const std::string end = fmt::format("@{}{}", this_host, partial_end);
    if (!name.starts_with(target) || !name.ends_with(end) || name.size() < target.size() + end.size()) return 0;
    name.remove_prefix(target.size());
    name.remove_suffix(end.size());
    if (!name.starts_with('.')) return 0;
    name.remove_prefix(1);
    pid_t process = 0;
    int attempt = -1;
    const char* const last = name.data() + name.size();
    const auto [dash, wrong] = std::from_chars(name.data(), last, process);
    if (wrong != std::errc() || process <= 0 || dash == last || *dash != '-') return 0;
    const auto [rest, wrong_too] = std::from_chars(dash + 1, last, attempt);
    return wrong_too == std::errc() && rest == last && attempt >= 0 ? process : 0;
}

/// Whether it is a regular file that no process works on.
bool is_abandoned(const fs::path& path) {
    const Descriptor file(open(path.c_str(), O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    struct stat status = {};
    return file.valid() && fstat(file.get(), &status) == 0 && S_ISREG(status.st_mode) && lock_for_life(file.get());
}

/// Removes the partial files of the target whose process was of this machine and is no more.
void remove_abandoned(const fs::path& target) {
    const std::string this_host = host();
    const std::string name = target.filename().string();
    std::error_code error;
    for (fs::directory_iterator entry(target.parent_path(), error), end; !error && entry != end;
         entry.increment(error)) {
        const pid_t process = writer_of(entry->path().filename().string(), name, this_host);
        if (process == 0 || kill(process, 0) == 0 || errno != ESRCH || !is_abandoned(entry->path())) continue;
        if (unlink(entry->path().c_str()) != 0) continue;
        notice(fmt::format("removed {}, which was left by a run that was killed", printable(entry->path())));
    }
}

/// Brings a file to the disk; returns 0 or errno. Throws Interrupted if the user asks to stop during the call, not if
/// that happened before: a caller that writes after an interruption needs the file.
int bring_to_disk(int descriptor) {
    const bool before = interrupted();
    struct stat status = {};
    // In pieces, because nothing can stop an fsync() that has begun.
    constexpr off_t piece = off_t{32} << 20;
    if (fstat(descriptor, &status) != 0) return errno;
    for (off_t begin = 0; begin < status.st_size; begin += piece) {
        if (!before) check_interrupt();
        constexpr unsigned now = SYNC_FILE_RANGE_WAIT_BEFORE | SYNC_FILE_RANGE_WRITE | SYNC_FILE_RANGE_WAIT_AFTER;
        if (sync_file_range(descriptor, begin, piece, now) != 0) break;  // fsync() reports the error
    }
    return fsync(descriptor) == 0 || errno == EINVAL ? 0 : errno;
}

/// Whether a call failed because the file system, or the kernel, does not know it.
bool is_unknown(int error) { return error == EINVAL || error == ENOSYS || error == EOPNOTSUPP || error == EPERM; }

/// Gives a file another name that no file has; returns 0 or errno, EEXIST if a file has that name.
int move_to_free_name(const fs::path& from, const fs::path& to) {
    if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
    if (!is_unknown(errno)) return errno;
    if (link(from.c_str(), to.c_str()) == 0) return unlink(from.c_str()) == 0 ? 0 : errno;
    if (!is_unknown(errno)) return errno;
    // A file system without links (FAT): looking first is all that can be done.
    struct stat status = {};
    if (lstat(to.c_str(), &status) == 0) return EEXIST;
    return rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

int exchange(const fs::path& one, const fs::path& other) {
    return renameat2(AT_FDCWD, one.c_str(), AT_FDCWD, other.c_str(), RENAME_EXCHANGE) == 0 ? 0 : errno;
}

[[noreturn]] void fail(const fs::path& target, int error) {
    throw RunError(fmt::format("cannot write {}: {}", printable(target), reason(error)));
}

}  // namespace

fs::path follow_links(const fs::path& path) {
    constexpr int most_links = 40;
    std::error_code error;
    fs::path at = path;
    for (int i = 0; i < most_links && fs::is_symlink(fs::symlink_status(at, error)); ++i)
        at = at.parent_path() / fs::read_symlink(at, error);
    return at;
}

std::optional<AtomicPath::Identity> AtomicPath::identity_of(const fs::path& path) {
    struct stat status = {};
    if (lstat(path.c_str(), &status) != 0) return std::nullopt;
    return Identity{status.st_dev, status.st_ino, status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
}

AtomicPath::AtomicPath(const fs::path& target) : target_(resolve(target)), found_(identity_of(target_)) {
    {
        // A signal that ends the process between the two would leave the file.
        const HoldEnd hold;
        descriptor_ = claim(target_, found_.has_value(), partial_);
        remove_on_kill_.emplace(partial_.string());
    }
    remove_abandoned(target_);
}

AtomicPath::~AtomicPath() {
    if (!settled_ && has_partial()) unlink(partial_.c_str());
}

void AtomicPath::commit() {
    if (const int error = bring_to_disk(descriptor_.get()); error != 0) fail(target_, error);
    if (!has_partial()) {
        throw RunError(fmt::format("cannot write {}: somebody has removed or replaced {} while it was written",
                                   printable(target_), printable(partial_)));
    }
    if (found_) keep_owner_and_mode();
    {
        const HoldEnd hold;
        give_name();
    }
    // The new name is in force already; some file systems cannot sync a directory, and nothing is lost without it.
    const Descriptor folder(open(target_.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder.valid()) fsync(folder.get());
}

/// Whether the partial name is still of the file that was claimed and written.
bool AtomicPath::has_partial() const {
    struct stat claimed = {};
    struct stat named = {};
    return fstat(descriptor_.get(), &claimed) == 0 && lstat(partial_.c_str(), &named) == 0 &&
           claimed.st_dev == named.st_dev && claimed.st_ino == named.st_ino;
}

void AtomicPath::keep_owner_and_mode() const {
    struct stat old = {};
    struct stat ours = {};
    if (lstat(target_.c_str(), &old) != 0 || !S_ISREG(old.st_mode)) return;
    if (fstat(descriptor_.get(), &ours) != 0) return;
    constexpr uid_t as_it_is = -1;
    mode_t mode = old.st_mode & 07777;
    const bool owner_kept = old.st_uid == ours.st_uid || fchown(descriptor_.get(), old.st_uid, as_it_is) == 0;
    const bool group_kept = old.st_gid == ours.st_gid || fchown(descriptor_.get(), as_it_is, old.st_gid) == 0;
    // Another group gets no more rights than all users have, and no user gets the rights of another owner or group.
    if (!group_kept) mode = (mode & ~mode_t{02070}) | (mode & ((mode & 07) << 3));
    if (!owner_kept) mode &= ~mode_t{04000};
    fchmod(descriptor_.get(), mode);
}

void AtomicPath::give_name() {
    if (!found_) return give_new_name();
    const std::optional<Identity> there = identity_of(target_);
    if (!there) return give_new_name();  // removed meanwhile: no file is lost
    if (there != found_) refuse_to_replace("changed or replaced it");
    replace_found();
}

void AtomicPath::give_new_name() {
    const int error = move_to_free_name(partial_, target_);
    if (error == EEXIST) refuse_to_replace("made it");
    if (error != 0) fail(target_, error);
    settled();
    note_written(target_);
}

void AtomicPath::replace_found() {
    // Not under the partial name: the file that is exchanged for the target would get that name, and partial files are
    // removed.
    const fs::path aside = move_to_free_path();
    if (aside.empty()) {
        if (std::rename(partial_.c_str(), target_.c_str()) != 0) fail(target_, errno);
        settled();
        return note_written(target_);
    }
    const int error = exchange(aside, target_);
    if (error == 0 && identity_of(aside) == found_) {
        unlink(aside.c_str());
    } else if (error == 0) {
        // Another process was faster: both files get their names back.
        exchange(aside, target_);
        partial_ = aside;
        refuse_to_replace("changed or replaced it");
    } else if (std::rename(aside.c_str(), target_.c_str()) != 0) {
        // For example for another user's file in a folder like /tmp: the error is known only now, after the work.
        const int failed = errno;
        note_written(aside);
        throw RunError(fmt::format("cannot write {}: {}; the new content is in {}", printable(target_), reason(failed),
                                   printable(aside)));
    }
    note_written(target_);
}

/// Moves the partial file to a free name next to the target; empty where that fails.
fs::path AtomicPath::move_to_free_path() {
    constexpr int most = 1000;
    for (int number = 1; number <= most; ++number) {
        fs::path free_path = fmt::format("{}.ringlock-{}", target_.string(), number);
        const int error = move_to_free_name(partial_, free_path);
        if (error == EEXIST) continue;
        if (error != 0) break;
        settled();
        return free_path;
    }
    return {};
}

void AtomicPath::settled() {
    settled_ = true;
    remove_on_kill_.reset();
}

void AtomicPath::refuse_to_replace(std::string_view what_happened) {
    const fs::path free_path = settled_ ? partial_ : move_to_free_path();
    if (!free_path.empty()) note_written(free_path);
    throw RunError(fmt::format("cannot write {}: somebody has {} since this run began, and it is kept; {}",
                               printable(target_), what_happened,
                               free_path.empty() ? std::string("the new content could not be kept next to it")
                                                 : fmt::format("the new content is in {}", printable(free_path))));
}

void write_text(const fs::path& path, std::string_view text) {
    AtomicPath target(path);
    write_text(target, text);
}

void write_text(AtomicPath& target, std::string_view text) {
    if (const int error = write_all(target.descriptor(), text); error != 0) fail(target.target(), error);
    target.commit();
}

}  // namespace ringlock
