#pragma once
#include <filesystem>
#include <optional>

#include "engine/core/atomic_path.hpp"
#include "engine/store/hdf5.hpp"

namespace ringlock::store {

/// An HDF5 file that appears whole or not at all (see AtomicPath).
class AtomicFile {
   public:
    /// Claims the name. Throws InputError where the target cannot be written.
    explicit AtomicFile(const std::filesystem::path& target);

    /// Made at the first call.
    File& file();
    const std::filesystem::path& target() const { return path_.target(); }

    /// Closes the file, brings it to the disk and gives it the target's name. Throws RunError where the disk refuses.
    void commit();

   private:
    AtomicPath path_;  // outlives the file, whose name it removes
    std::filesystem::path shown_as_;
    std::optional<File> file_;
};

}  // namespace ringlock::store
