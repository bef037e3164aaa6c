#include "app/room.hpp"

#include <fmt/format.h>

#include <system_error>

#include "app/output.hpp"
#include "engine/core/error.hpp"
#include "engine/core/free_memory.hpp"

namespace ringlock::app {
namespace {

double in_gb(std::uint64_t bytes) { return static_cast<double>(bytes) * 1e-9; }

}  // namespace

void check_room(const std::filesystem::path& out, const Needs& needs, bool quiet) {
    const std::uint64_t memory = free_memory_bytes();
    if (needs.memory_bytes > memory) {
        throw InputError(fmt::format("{}: about {:.2g} GB of memory would be taken, and {:.2g} GB are free; {}",
                                     out.string(), in_gb(needs.memory_bytes), in_gb(memory), needs.less_memory));
    }
    std::error_code unknown;
    const auto folder = out.has_parent_path() ? out.parent_path() : std::filesystem::path(".");
    const std::filesystem::space_info disk = std::filesystem::space(folder, unknown);
    if (!unknown && needs.disk_bytes > disk.available) {
        throw InputError(
            fmt::format("{}: about {:.2g} GB of the disk would be taken, and {:.2g} GB are free; {}or give "
                        "a place on another disk with -o",
                        out.string(), in_gb(needs.disk_bytes), in_gb(disk.available),
                        needs.less_disk.empty() ? "" : needs.less_disk + ", "));
    }
    constexpr std::uint64_t worth_telling = 1'000'000'000;
    if (quiet || needs.memory_bytes < worth_telling) return;
    tell(fmt::format("{}: about {:.2g} GB of memory will be taken, of {:.2g} GB that are free\n", out.string(),
                     in_gb(needs.memory_bytes), in_gb(memory)));
}

}  // namespace ringlock::app
