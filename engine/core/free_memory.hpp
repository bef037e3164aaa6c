#pragma once
#include <cstdint>
#include <filesystem>

namespace ringlock {

/// Bytes of memory that this process may still take without anything being swapped out or killed: the minimum of the
/// machine's available memory (MemAvailable), the memory that the control groups of the process leave (versions 1 and
/// 2; a cache of files that they can drop counts as free), and the memory that its own limit leaves (`ulimit -v`).
///
/// \param root  where /proc and /sys are; tests give a tree of their own
std::uint64_t free_memory_bytes(const std::filesystem::path& root = "/");

}  // namespace ringlock
