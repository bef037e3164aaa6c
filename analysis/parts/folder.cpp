#include "analysis/parts/folder.hpp"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <iterator>
#include <system_error>

#include "analysis/parts/part_files.hpp"
#include "analysis/parts/status.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/system_text.hpp"

namespace ringlock::parts {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view lock_name = "run.lock";
constexpr std::string_view damaged_suffix = ".damaged";
constexpr std::string_view folder_suffix = ".parts";

bool is_of_run(const fs::path& file) {
    const std::string name = file.filename().string();
    return name == lock_name || name == status_name || name == manifest_name || name.ends_with(part_suffix) ||
           name.ends_with(partial_suffix) || name.ends_with(damaged_suffix);
}

std::vector<fs::path> contents(const fs::path& folder) {
    std::vector<fs::path> found;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) found.push_back(entry.path());
    std::sort(found.begin(), found.end());
    return found;
}

std::string first_line(const fs::path& file) {
    std::ifstream in(file);
    std::string text;
    std::getline(in, text);
    return text;
}

std::string this_process() {
    std::array<char, 256> host{};
    if (gethostname(host.data(), host.size() - 1) != 0) host[0] = '?';
    return fmt::format("process {} on {} since {:%Y-%m-%dT%H:%M:%SZ}", getpid(), host.data(),
                       fmt::gmtime(std::time(nullptr)));
}

/// Whether the open file still has the name: its folder may have been removed by the process that held it.
bool has_name(int fd, const fs::path& path) {
    struct stat opened {};
    struct stat named {};
    return fstat(fd, &opened) == 0 && stat(path.c_str(), &named) == 0 && opened.st_dev == named.st_dev &&
           opened.st_ino == named.st_ino;
}

}  // namespace

fs::path folder_of(const fs::path& output) {
    return follow_links(fs::absolute(output)).string() + std::string(folder_suffix);
}

fs::path shard_file(const fs::path& output, const Shard& shard) {
    return fmt::format("{}.shard-{}-of-{}", output.string(), shard.number, shard.count);
}

std::vector<Shard> shards_begun(const fs::path& output) {
    const std::string begin = output.filename().string() + ".shard-";
    const fs::path folder = output.has_parent_path() ? output.parent_path() : fs::path(".");
    std::vector<Shard> found;
    for (const fs::path& there : contents(folder)) {
        std::string name = there.filename().string();
        if (!name.starts_with(begin)) continue;
        name.erase(0, begin.size());
        if (name.ends_with(folder_suffix)) name.resize(name.size() - folder_suffix.size());
        const std::size_t of = name.find("-of-");
        if (of == std::string::npos) continue;
        try {
            found.push_back(parse_shard(fmt::format("{}/{}", name.substr(0, of), name.substr(of + 4))));
        } catch (const InputError&) {
            continue;  // a file with a similar name, not of ours
        }
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
}

std::vector<fs::path> shard_files(const fs::path& output) {
    std::vector<fs::path> files;
    for (const Shard& shard : shards_begun(output)) {
        if (const fs::path file = shard_file(output, shard); fs::is_regular_file(file)) files.push_back(file);
    }
    return files;
}

std::vector<fs::path> part_files(const fs::path& folder) {
    std::vector<fs::path> found = contents(folder);
    std::erase_if(found, [](const fs::path& file) { return !file.filename().string().ends_with(part_suffix); });
    return found;
}

std::string holder(const fs::path& folder) {
    const fs::path lock = folder / lock_name;
    const int fd = open(lock.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (fd < 0) return "";
    const bool held = flock(fd, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    close(fd);
    return held ? first_line(lock) : "";
}

Folder::Folder(const fs::path& output, const Manifest& manifest, Beginning beginning, const Tell& tell)
    : output_(output), path_(folder_of(output)), manifest_(manifest) {
    lock_or_refuse();
    try {
        const std::vector<fs::path> found = files();
        if (!found.empty() && beginning == Beginning::refuse) {
            throw InputError(
                fmt::format("{}: holds finished gyros of a run of {} that was interrupted; "
                            "go on with --resume, or begin anew with --discard",
                            printable(path_), printable(output)));
        }
        if (beginning == Beginning::discard) {
            for (const fs::path& file : found) fs::remove(file);
        } else if (!found.empty()) {
            std::vector<std::string> other;
            // A damaged file does not identify its run; it is reported when it is read.
            for (const fs::path& file : found) {
                try {
                    other = differences(read_manifest(file), manifest_);
                    break;
                } catch (const InputError&) {
                    continue;
                }
            }
            if (!other.empty()) {
                throw InputError(
                    fmt::format("{}: holds finished gyros of another run, which cannot be resumed by this one; "
                                "they differ in\n  {}\nRun the same scenario as before, or begin anew with --discard",
                                printable(path_), fmt::join(other, "\n  ")));
            }
        }
        clear(tell);
        replace_text(path_ / manifest_name, to_json(manifest_));
    } catch (...) {
        if (!has_finished()) remove();
        close(lock_fd_);
        throw;
    }
}

Folder::~Folder() {
    if (lock_fd_ < 0) return;
    if (!has_finished()) remove();
    close(lock_fd_);
}

void Folder::lock_or_refuse() {
    const fs::path lock = path_ / lock_name;
    for (;;) {
        if (mkdir(path_.c_str(), 0777) != 0) {
            if (errno != EEXIST) {
                throw InputError(
                    fmt::format("{}: cannot be made: {}; it keeps the finished gyros of a run. "
                                "Name an output in a folder that can be written",
                                printable(path_), system_text(errno)));
            }
            const std::vector<fs::path> there = contents(path_);
            if (!fs::is_directory(path_) || !std::all_of(there.begin(), there.end(), is_of_run)) {
                throw InputError(fmt::format("{}: exists and is not a folder of a run; it is kept. Name another output",
                                             printable(path_)));
            }
        }
        const int fd = open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
        if (fd < 0) {
            if (errno == ENOENT) continue;  // the process that held it has just removed it
            throw InputError(fmt::format("{}: cannot be made: {}", printable(lock), system_text(errno)));
        }
        if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
            const int error = errno;
            close(fd);
            if (error == EWOULDBLOCK) {
                throw InputError(fmt::format("{}: is being written by {}; wait for it, or name another output with -o",
                                             printable(output_), first_line(lock)));
            }
            throw InputError(fmt::format("{}: cannot be locked: {}; name an output on a file system with locks",
                                         printable(lock), system_text(error)));
        }
        if (has_name(fd, lock)) {
            lock_fd_ = fd;
            break;
        }
        close(fd);
    }
    who_ = this_process();
    const std::string who = who_ + "\n";
    if (ftruncate(lock_fd_, 0) != 0 || pwrite(lock_fd_, who.data(), who.size(), 0) < 0) {
        const int error = errno;
        remove();
        close(lock_fd_);
        throw RunError(fmt::format("{}: cannot be written: {}", printable(lock), system_text(error)));
    }
}

void Folder::clear(const Tell& tell) const {
    for (const fs::path& file : contents(path_)) {
        if (!file.filename().string().ends_with(partial_suffix)) continue;
        fs::remove(file);
        tell(fmt::format("removed {}, which an interrupted run left unfinished", printable(file)));
    }
}

std::vector<fs::path> Folder::files() const { return part_files(path_); }

bool Folder::has_finished() const { return !files().empty(); }

void Folder::remove() {
    std::error_code stays;
    for (const fs::path& file : contents(path_)) {
        if (is_of_run(file) && file.filename() != lock_name) fs::remove(file, stays);
    }
    // The lock is removed last: until then no other process can take over the remaining files.
    fs::remove(path_ / lock_name, stays);
    rmdir(path_.c_str());
}

}  // namespace ringlock::parts
