#pragma once
#include <functional>
#include <string>

namespace ringlock::record {

/// HDF5 1.10 can crash on damaged files: it copies a string of variable length by the length that the file's heap
/// names. So reading is tried in a process of its own first. Throws InputError, naming `path`, where that process does
/// not come to its end; what `read` throws is of no account here. `read` must not need other threads.
void try_reading(const std::string& path, const std::function<void()>& read);

}  // namespace ringlock::record
