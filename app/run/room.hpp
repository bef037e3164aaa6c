#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

/// Checks memory and disk before either is used.
namespace ringlock::app {

/// Memory and disk space that a command is about to take.
struct Needs {
    std::uint64_t memory_bytes = 0;
    std::function<std::uint64_t()> disk_bytes;  ///< size of the output; called if the memory suffices
    std::string less_memory;                    ///< advice where the memory does not suffice, as in "take fewer gyros"
    std::string less_disk;  ///< advice where the disk does not suffice, other than writing the output elsewhere
};

/// Throws InputError if the command needs more than the free memory or the free space on the disk of the output.
/// Reports an estimate above 1 GB unless `quiet` is set.
void check_room(const std::filesystem::path& out, const Needs& needs, bool quiet);

}  // namespace ringlock::app
