#include "engine/store/atomic_file.hpp"

namespace ringlock::store {

AtomicFile::AtomicFile(const std::filesystem::path& target)
    : path_(target), file_(File::create(path_.partial(), target)) {}

void AtomicFile::commit() {
    file_.close();
    path_.commit();
}

}  // namespace ringlock::store
