#include "engine/ensemble/progress.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <string_view>
#include <utility>

namespace ringlock::ensemble {
namespace {

constexpr double bar_interval_s = 0.2;
constexpr double line_interval_s = 10.0;

int terminal_columns() {
    winsize size{};
    constexpr int usual = 80;
    return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : usual;
}

bool terminal_with_cursor() {
    const char* kind = std::getenv("TERM");
    return isatty(STDERR_FILENO) == 1 && kind != nullptr && std::string_view(kind) != "dumb";
}

/// "8 s", "2 min 05 s", "3 h 07 min".
std::string duration(double seconds) {
    const auto whole = static_cast<std::int64_t>(std::ceil(seconds));
    if (whole < 60) return fmt::format("{} s", whole);
    if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
    return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

/// "850 turns/s", "12.3 k turns/s", "4.56 M turns/s".
std::string turn_rate(double per_s) {
    constexpr std::pair<double, const char*> steps[] = {{1e9, "G "}, {1e6, "M "}, {1e3, "k "}};
    for (const auto& [scale, prefix] : steps)
        if (per_s >= scale) return fmt::format("{:.3g} {}turns/s", std::min(per_s / scale, 999.0), prefix);
    return fmt::format("{:.0f} turns/s", per_s);
}

}  // namespace

ProgressSink ProgressSink::standard_error() {
    return {.stream = &std::cerr, .terminal = terminal_with_cursor(), .columns = terminal_columns, .now_s = [] {
                return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
            }};
}

Progress::Progress(std::int64_t total_gyros, ProgressOptions options, ProgressSink sink)
    : total_gyros_(total_gyros), options_(options), sink_(std::move(sink)), start_s_(sink_.now_s()) {
    if (!options_.quiet) show(start_s_);
}

Progress::~Progress() {
    if (bar_on_screen_) clear_line();
}

void Progress::advance(std::int64_t gyros, std::int64_t turns) {
    gyros_ += gyros;
    turns_ += turns;
    if (options_.quiet) return;
    const std::unique_lock lock(output_mutex_, std::try_to_lock);
    if (!lock) return;
    const double now_s = sink_.now_s();
    if (now_s - last_shown_s_ >= (sink_.terminal ? bar_interval_s : line_interval_s)) show(now_s);
}

void Progress::finish() {
    if (options_.quiet) return;
    const std::lock_guard lock(output_mutex_);
    if (sink_.terminal)
        clear_line();
    else
        show_line(sink_.now_s() - start_s_);
}

double Progress::share_done() const {
    const bool by_turns = options_.total_turns > 0;
    const auto done = static_cast<double>(by_turns ? turns_ : gyros_);
    const auto total = static_cast<double>(by_turns ? options_.total_turns : total_gyros_);
    return total > 0.0 ? std::clamp(done / total, 0.0, 1.0) : 1.0;
}

void Progress::show(double now_s) {
    last_shown_s_ = now_s;
    if (sink_.terminal)
        show_bar(now_s - start_s_);
    else
        show_line(now_s - start_s_);
}

void Progress::show_bar(double elapsed_s) {
    const double share = share_done();
    const std::string percent = fmt::format("{:3.0f} % ", std::floor(100.0 * share));
    std::string rest = fmt::format(" {}/{} gyros", gyros_.load(), total_gyros_);
    if (turns_ > 0 && elapsed_s > 0.0) rest += ", " + turn_rate(static_cast<double>(turns_) / elapsed_s);
    if (share > 0.0) rest += ", " + duration(elapsed_s * (1.0 - share) / share) + " left";
    // The last column stays free: a terminal may wrap as soon as it is filled.
    constexpr int shortest_bar = 5;
    constexpr int longest_bar = 40;
    const int room = std::max(sink_.columns() - 1, 0);
    const int cells = std::min(room - static_cast<int>(percent.size() + rest.size()) - 2, longest_bar);
    std::string bar;
    if (cells >= shortest_bar) {
        const int filled = static_cast<int>(share * cells);
        bar = fmt::format("[{:#<{}}{:-<{}}]", "", filled, "", cells - filled);
    }
    const std::string line = percent + bar + rest;
    *sink_.stream << "\r\x1b[K" << line.substr(0, room) << std::flush;
    bar_on_screen_ = true;
}

void Progress::show_line(double elapsed_s) {
    const double share = share_done();
    std::string line = fmt::format("{:.0f} %, {} of {} gyros", std::floor(100.0 * share), gyros_.load(), total_gyros_);
    if (turns_ > 0 && elapsed_s > 0.0) line += ", " + turn_rate(static_cast<double>(turns_) / elapsed_s);
    if (share >= 1.0)
        line += ", took " + duration(elapsed_s);
    else if (share > 0.0)
        line += ", " + duration(elapsed_s * (1.0 - share) / share) + " left";
    *sink_.stream << line << '\n' << std::flush;
}

void Progress::clear_line() {
    *sink_.stream << "\r\x1b[K" << std::flush;
    bar_on_screen_ = false;
}

}  // namespace ringlock::ensemble
