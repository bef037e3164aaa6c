#pragma once
#include <filesystem>

#include "engine/store/hdf5.hpp"

namespace ringlock::test {

/// A file that a test has made, opened for reading.
inline store::File open_file(const std::filesystem::path& path) {
    return store::guarded(path, [](const store::GuardedPath& guarded) { return store::File::open(guarded); });
}

}  // namespace ringlock::test
