#include "app/files.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <system_error>

#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

namespace fs = std::filesystem;
using Use = NamedFile::Use;

bool is_file(const NamedFile& file) { return !file.path.empty() && (file.use == Use::output || file.path != "-"); }

/// Where a file is or would be: without links and dots, as far as its folders are there.
fs::path place_of(const fs::path& path) {
    std::error_code error;
    const fs::path followed = follow_links(fs::absolute(path, error));
    const fs::path place = fs::weakly_canonical(followed, error);
    return error ? followed.lexically_normal() : place;
}

bool are_same(const fs::path& one, const fs::path& other) {
    struct stat first = {};
    struct stat second = {};
    const bool both = stat(one.c_str(), &first) == 0 && stat(other.c_str(), &second) == 0;
    if (both) return first.st_dev == second.st_dev && first.st_ino == second.st_ino;
    return place_of(one) == place_of(other);
}

}  // namespace

void refuse_same_files(const std::vector<NamedFile>& files) {
    for (auto one = files.begin(); one != files.end(); ++one) {
        for (auto other = files.begin(); other != one; ++other) {
            if (one->use == Use::input && other->use == Use::input) continue;
            if (!is_file(*one) || !is_file(*other) || !are_same(one->path, other->path)) continue;
            throw InputError(
                fmt::format("{} {} and {} {} are the same file, which would be {}; nothing was done. Name another file",
                            other->argument, printable(other->path), one->argument, printable(one->path),
                            one->use == other->use ? "written twice" : "read and written over"));
        }
    }
}

}  // namespace ringlock::app
