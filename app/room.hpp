#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

/// Memory and disk are asked about before any of either is taken.
namespace ringlock::app {

/// What a command is about to take.
struct Needs {
    std::uint64_t memory_bytes = 0;
    std::function<std::uint64_t()> disk_bytes;  ///< where the output is; asked where the memory suffices
    std::string less_memory;                    ///< what to do where memory does not suffice, as in "take fewer gyros"
    std::string less_disk;                      ///< likewise the disk, beside another place for the output
};

/// Refuses what the memory that is free or the disk of the output cannot hold; unless quiet, tells of what
/// is above 1 GB. Throws InputError.
void check_room(const std::filesystem::path& out, const Needs& needs, bool quiet);

}  // namespace ringlock::app
