#include "app/run/room.hpp"

#include <fmt/format.h>

#include <system_error>

#include "app/output.hpp"
#include "engine/core/error.hpp"
#include "engine/core/free_memory.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

double in_gb(std::uint64_t bytes) { return static_cast<double>(bytes) * 1e-9; }

}  // namespace

void check_room(const std::filesystem::path& out, const Needs& needs, bool quiet) {
    const std::uint64_t memory = free_memory_bytes();
    if (needs.memory_bytes > memory) {
        throw InputError(fmt::format("{}: about {:.2g} GB of memory would be taken, and {:.2g} GB are free; {}",
                                     printable(out), in_gb(needs.memory_bytes), in_gb(memory), needs.less_memory));
    }
    std::error_code unknown;
    const auto folder = out.has_parent_path() ? out.parent_path() : std::filesystem::path(".");
    const std::filesystem::space_info disk = std::filesystem::space(folder, unknown);
    const std::uint64_t disk_bytes = needs.disk_bytes();
    if (!unknown && disk_bytes > disk.available) {
        throw InputError(
            fmt::format("{}: about {:.2g} GB of the disk would be taken, and {:.2g} GB are free; "
                        "{}, or give a place on another disk with -o",
                        printable(out), in_gb(disk_bytes), in_gb(disk.available), needs.less_disk));
    }
    if (quiet) return;
    constexpr std::uint64_t worth_telling = 1'000'000'000;
    const auto announce = [&](std::uint64_t bytes, std::uint64_t free, const char* what) {
        if (bytes < worth_telling) return;
        tell(fmt::format("{}: about {:.2g} GB of {} will be taken, of {:.2g} GB that are free\n", printable(out),
                         in_gb(bytes), what, in_gb(free)));
    };
    announce(needs.memory_bytes, memory, "memory");
    if (!unknown) announce(disk_bytes, disk.available, "the disk");
}

}  // namespace ringlock::app
