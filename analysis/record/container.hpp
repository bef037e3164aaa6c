#pragma once
#include <string>

namespace ringlock::record {

/// What a file of numbers is, by its first bytes: its name may say anything.
enum class Container { text, hdf5, npy, npz, mat };

/// Pipes, and whatever has no mark of the others, are text. Throws InputError where the file cannot be opened or is a
/// folder.
Container container_of(const std::string& path);

/// "an array of NumPy (.npy)"
const char* name_of(Container container);

}  // namespace ringlock::record
