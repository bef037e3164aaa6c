#include "engine/core/notice.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <mutex>
#include <string>
#include <utility>

#include "engine/core/printable.hpp"

namespace ringlock {
namespace {

std::mutex sink_mutex;
std::function<void(std::string_view)> sink_in_force;

}  // namespace

void notice(std::string_view text) {
    const std::lock_guard lock(sink_mutex);
    if (sink_in_force) return sink_in_force(text);
    const std::string line = fmt::format("ringlock: {}\n", without_controls(text));
    if (std::fwrite(line.data(), 1, line.size(), stderr) != line.size()) std::clearerr(stderr);
}

void set_notice_sink(std::function<void(std::string_view text)> sink) {
    const std::lock_guard lock(sink_mutex);
    sink_in_force = std::move(sink);
}

}  // namespace ringlock
