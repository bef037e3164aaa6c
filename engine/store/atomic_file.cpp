#include "engine/store/atomic_file.hpp"

namespace ringlock::store {

AtomicFile::AtomicFile(const std::filesystem::path& target) : path_(target), shown_as_(target) {}

File& AtomicFile::file() {
    if (!file_) file_ = File::create(path_.partial(), shown_as_);
    return *file_;
}

void AtomicFile::commit() {
    file().close();
    path_.commit();
}

}  // namespace ringlock::store
