#pragma once
#include <string>

namespace ringlock::record {

/// Format of a file of numbers, by its first bytes and not by its name.
enum class Container { text, hdf5, npy, npz, mat };

/// Pipes, and files without a mark of the other formats, are text. Throws InputError where the file cannot be opened or
/// is a folder.
Container container_of(const std::string& path);

/// "an array of NumPy (.npy)"
const char* name_of(Container container);

}  // namespace ringlock::record
