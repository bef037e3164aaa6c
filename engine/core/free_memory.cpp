#include "engine/core/free_memory.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>

namespace ringlock {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t unlimited = std::numeric_limits<std::uint64_t>::max();

/// The number that the file consists of; nothing where the file holds no number ("max").
std::optional<std::uint64_t> number_in(const fs::path& path) {
    std::ifstream file(path);
    std::uint64_t value = 0;
    if (file >> value) return value;
    return std::nullopt;
}

/// The number behind a word at the beginning of a line.
std::optional<std::uint64_t> number_after(const fs::path& path, std::string_view word) {
    std::ifstream file(path);
    std::string line;
    while (std::getline(file, line)) {
        std::istringstream fields(line);
        std::string first;
        std::uint64_t value = 0;
        if (fields >> first >> value && first == word) return value;
    }
    return std::nullopt;
}

std::uint64_t available_bytes(const fs::path& root) {
    if (const auto kib = number_after(root / "proc/meminfo", "MemAvailable:")) return *kib * 1024;
    return static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

/// Names of a control group's files in one of the two versions.
struct Names {
    const char* limit;
    const char* usage;
    const char* cached;
    const char* cached_too;
};
constexpr Names version_1{"memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file", "total_active_file"};
constexpr Names version_2{"memory.max", "memory.current", "inactive_file", "active_file"};

std::uint64_t left_in(const fs::path& group, const Names& names) {
    const auto limit = number_in(group / names.limit);
    const auto usage = number_in(group / names.usage);
    if (!limit || !usage) return unlimited;
    std::uint64_t cached = 0;
    for (const char* const word : {names.cached, names.cached_too}) {
        cached += number_after(group / "memory.stat", word).value_or(0);
    }
    const std::uint64_t taken = *usage - std::min(*usage, cached);
    return *limit - std::min(*limit, taken);
}

/// Memory that a group and those above it leave [bytes]. A container may see its own group as the topmost.
std::uint64_t left_in_all(const fs::path& top, const fs::path& group, const Names& names) {
    std::uint64_t left = left_in(top, names);
    fs::path at = top;
    for (const fs::path& step : group.relative_path()) left = std::min(left, left_in(at /= step, names));
    return left;
}

std::uint64_t left_in_control_groups(const fs::path& root) {
    std::ifstream file(root / "proc/self/cgroup");
    std::string line;
    std::uint64_t left = unlimited;
    while (std::getline(file, line)) {  // number:controllers:path
        const std::size_t first = line.find(':');
        const std::size_t second = line.find(':', first + 1);
        if (first == std::string::npos || second == std::string::npos) continue;
        const std::string controllers = fmt::format(",{},", line.substr(first + 1, second - first - 1));
        const fs::path group = line.substr(second + 1);
        const fs::path top = root / "sys/fs/cgroup";
        if (controllers == ",,") left = std::min(left, left_in_all(top, group, version_2));
        if (controllers.find(",memory,") != std::string::npos) {
            left = std::min(left, left_in_all(top / "memory", group, version_1));
        }
    }
    return left;
}

std::uint64_t left_in_own_limit(const fs::path& root) {
    rlimit limit = {};
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return unlimited;
    const std::uint64_t pages = number_in(root / "proc/self/statm").value_or(0);
    const std::uint64_t taken = pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
    return limit.rlim_cur - std::min<std::uint64_t>(limit.rlim_cur, taken);
}

}  // namespace

std::uint64_t free_memory_bytes(const fs::path& root) {
    return std::min({available_bytes(root), left_in_control_groups(root), left_in_own_limit(root)});
}

}  // namespace ringlock
