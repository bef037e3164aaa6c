#include "engine/core/atomic_path.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <system_error>

#include "engine/core/error.hpp"

namespace ringlock {
namespace fs = std::filesystem;
namespace {

std::string reason(int error) { return std::generic_category().message(error); }

/// Where a symbolic link leads, also if nothing is there yet. A circle of links comes back as one of its links.
fs::path follow(fs::path path) {
    constexpr int most_links = 40;
    std::error_code error;
    for (int i = 0; i < most_links && fs::is_symlink(fs::symlink_status(path, error)); ++i)
        path = path.parent_path() / fs::read_symlink(path, error);
    return path;
}

fs::path resolve(const fs::path& target) {
    if (target.empty()) throw InputError("the name of the output file is empty; give one");
    const fs::path resolved = follow(fs::absolute(target));
    std::error_code error;
    const fs::file_status status = fs::status(resolved, error);
    if (fs::is_directory(status))
        throw InputError(fmt::format("cannot write {}: it is a directory; name a file in it", target.string()));
    if (fs::exists(status) && !fs::is_regular_file(status))
        throw InputError(
            fmt::format("cannot write {}: it is there and no regular file; name another", target.string()));
    return resolved;
}

[[noreturn]] void refuse(const fs::path& target, int error) {
    const std::string directory = target.parent_path().string();
    std::string what_to_do = "name a directory that can be written";
    if (error == ENOENT) what_to_do = "create it first (mkdir -p) or name another";
    if (error == ENAMETOOLONG) what_to_do = "choose a shorter name";
    throw InputError(
        fmt::format("cannot write {}: directory {}: {}; {}", target.string(), directory, reason(error), what_to_do));
}

/// Creates a file that did not exist, beside the target.
fs::path claim(const fs::path& target) {
    for (int attempt = 0;; ++attempt) {
        const fs::path partial = fmt::format("{}.{}-{}.partial", target.string(), getpid(), attempt);
        const int fd = open(partial.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
        if (fd >= 0) {
            close(fd);
            return partial;
        }
        if (errno != EEXIST) refuse(target, errno);
    }
}

/// Brings a file or directory to the disk; returns 0 or errno.
int sync(const fs::path& path, int flags) {
    const int fd = open(path.c_str(), flags | O_CLOEXEC);
    if (fd < 0) return errno;
    const int error = fsync(fd) == 0 ? 0 : errno;
    close(fd);
    return error;
}

}  // namespace

fs::path resolved_target(const fs::path& target) { return resolve(target); }

AtomicPath::AtomicPath(const fs::path& target) : target_(resolve(target)), partial_(claim(target_)) {
    remove_on_kill_.emplace(partial_.string());
}

AtomicPath::~AtomicPath() {
    if (!committed_) unlink(partial_.c_str());
}

void AtomicPath::commit() {
    if (const int error = sync(partial_, O_RDONLY); error != 0)
        throw RunError(fmt::format("cannot write {}: {}", target_.string(), reason(error)));
    if (std::rename(partial_.c_str(), target_.c_str()) != 0)
        throw RunError(fmt::format("cannot write {}: {}", target_.string(), reason(errno)));
    committed_ = true;
    remove_on_kill_.reset();
    // The new name is in force already; some file systems cannot sync a directory, and nothing is lost without it.
    sync(target_.parent_path(), O_RDONLY | O_DIRECTORY);
}

void write_text(const fs::path& path, std::string_view text) {
    AtomicPath target(path);
    errno = 0;
    std::ofstream file(target.partial(), std::ios::binary);
    file << text;
    file.close();
    if (!file) throw RunError(fmt::format("{}: cannot be written: {}", path.string(), reason(errno)));
    target.commit();
}

}  // namespace ringlock
