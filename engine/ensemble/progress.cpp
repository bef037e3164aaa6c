#include "engine/ensemble/progress.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <utility>

namespace ringlock::ensemble {
namespace {

using Seconds = std::chrono::duration<double>;

constexpr std::chrono::milliseconds bar_interval{200};
constexpr std::chrono::seconds line_interval{10};
constexpr int longest_bar = 40;
constexpr int shortest_bar = 10;

int width_of_standard_error() {
    winsize size{};
    return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

std::string duration(double seconds) {
    if (!(seconds < 1e9)) return "?";
    const auto s = static_cast<std::int64_t>(std::ceil(seconds));
    if (s < 60) return fmt::format("{} s", s);
    if (s < 3600) return fmt::format("{} min {:02} s", s / 60, s % 60);
    return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
}

}  // namespace

Progress::Progress(std::int64_t total_gyros, ProgressOptions options)
    : total_(total_gyros), options_(std::move(options)) {
    out_ = options_.out ? options_.out : &std::cerr;
    terminal_ = options_.out ? options_.is_terminal : ::isatty(STDERR_FILENO) == 1;
    if (!options_.clock) options_.clock = [] { return std::chrono::steady_clock::now(); };
    if (!options_.terminal_width) options_.terminal_width = width_of_standard_error;
    start_ = options_.clock();
    shown_ = start_;
}

Progress::~Progress() {
    const std::lock_guard lock(mutex_);
    try {
        if (!finished_) clear_bar();
    } catch (...) {  // a stream that throws on failure: nothing to be done here
    }
}

void Progress::advance(std::int64_t gyros, std::int64_t turns) {
    const std::lock_guard lock(mutex_);
    gyros_ += gyros;
    turns_ += turns;
    if (options_.quiet || finished_) return;
    const Time now = options_.clock();
    const bool due = terminal_ ? now - shown_ >= bar_interval : now - shown_ >= line_interval;
    if (any_shown_ && !due) return;
    show(now, false);
}

void Progress::finish() {
    const std::lock_guard lock(mutex_);
    if (options_.quiet || finished_) return;
    finished_ = true;
    if (terminal_) {
        clear_bar();
    } else {
        show(options_.clock(), true);
    }
}

double Progress::share_done() const {
    const double share = options_.total_turns > 0
                             ? static_cast<double>(turns_) / static_cast<double>(options_.total_turns)
                         : total_ > 0 ? static_cast<double>(gyros_) / static_cast<double>(total_)
                                      : 1.0;
    return std::clamp(share, 0.0, 1.0);
}

void Progress::show(Time now, bool last) {
    const double elapsed = Seconds(now - start_).count();
    const double done = share_done();
    // Cut off, not rounded: 100 % means that all is done.
    std::string status = fmt::format("{:3} %  {}/{} gyros", static_cast<int>(100.0 * done), gyros_, total_);
    if (elapsed > 0.0) status += fmt::format("  {:.3g} turns/s", static_cast<double>(turns_) / elapsed);
    if (last) {
        status += "  in " + duration(elapsed);
    } else if (done > 0.0 && elapsed > 0.0) {
        status += fmt::format("  {} left", duration(elapsed * std::max(0.0, 1.0 / done - 1.0)));
    }
    any_shown_ = true;
    shown_ = now;
    if (terminal_) {
        draw_bar(status);
    } else {
        *out_ << status << std::endl;
    }
}

void Progress::draw_bar(const std::string& status) {
    const int known = options_.terminal_width();
    const int width = (known > 0 ? known : 80) - 1;  // the last column would wrap on some terminals
    std::string line = status;
    const int room = std::min(longest_bar, width - static_cast<int>(status.size()) - 3);
    if (room >= shortest_bar) {
        const int full = static_cast<int>(room * share_done());
        line = fmt::format("[{}{}] {}", std::string(full, '='), std::string(room - full, ' '), status);
    }
    line.resize(std::min(line.size(), static_cast<std::size_t>(std::max(0, width))));
    *out_ << '\r' << line << "\x1b[K" << std::flush;  // the end of a longer line before is erased
    bar_visible_ = true;
}

void Progress::clear_bar() {
    if (!bar_visible_) return;
    *out_ << "\r\x1b[K" << std::flush;
    bar_visible_ = false;
}

}  // namespace ringlock::ensemble
