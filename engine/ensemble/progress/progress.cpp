#include "engine/ensemble/progress/progress.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <utility>

namespace ringlock::ensemble {
namespace {

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
    : total_gyros_(total_gyros), options_(std::move(options)) {
    out_ = options_.out ? options_.out : &std::cerr;
    terminal_ = options_.out ? options_.is_terminal : ::isatty(STDERR_FILENO) == 1;
    if (!options_.clock) options_.clock = [] { return std::chrono::steady_clock::now(); };
    if (!options_.terminal_width) options_.terminal_width = width_of_standard_error;
    read_ = options_.clock();
    planned_ = options_.already_done;
}

Progress::~Progress() {
    const std::lock_guard lock(mutex_);
    try {
        if (!finished_) clear_bar();
    } catch (...) {  // a stream that throws on failure: nothing to be done here
    }
}

void Progress::stage(const std::string& name) {
    const std::lock_guard lock(mutex_);
    if (finished_) return;
    read_clock();
    stage_ = name;
    // No event may follow for long that would draw the bar.
    if (terminal_) {
        show(false);
    } else {
        update();
    }
}

void Progress::plan(std::span<const PlannedBlock> blocks, int threads) {
    const std::lock_guard lock(mutex_);
    if (finished_) return;
    read_clock();
    stage_.clear();
    for (const PlannedBlock& block : blocks) {
        planned_.gyros += block.gyros;
        planned_.turns += block.turns;
    }
    left_s_.reset();
    time_left_.plan(blocks, threads);
    update();
}

void Progress::enter(std::size_t block, BlockStage stage) {
    const std::lock_guard lock(mutex_);
    if (finished_) return;
    read_clock();
    time_left_.enter(block, stage, now_s());
    update();
}

void Progress::advance(std::size_t block, std::int64_t gyros, std::int64_t turns, bool tabulated) {
    const std::lock_guard lock(mutex_);
    if (finished_) return;
    read_clock();
    gyros_ += gyros;
    turns_ += turns;
    time_left_.advance(block, turns, tabulated, now_s());
    update();
}

void Progress::finish() {
    const std::lock_guard lock(mutex_);
    if (finished_) return;
    read_clock();
    finished_ = true;
    if (options_.quiet) return;
    if (terminal_) {
        clear_bar();
    } else {
        show(true);
    }
}

void Progress::read_clock() {
    const Clock::time_point read = options_.clock();
    now_ += std::max(Clock::duration{}, read - read_);
    read_ = read;
}

ProgressOptions::Done Progress::done() const {
    return {options_.already_done.gyros + gyros_, options_.already_done.turns + turns_};
}

ProgressOptions::Done Progress::total() const {
    return options_.grows ? planned_ : ProgressOptions::Done{total_gyros_, options_.total_turns};
}

double Progress::share_done() const {
    const auto [gyros, turns] = done();
    const auto [all_gyros, all_turns] = total();
    const double share = all_turns > 0    ? static_cast<double>(turns) / static_cast<double>(all_turns)
                         : all_gyros > 0  ? static_cast<double>(gyros) / static_cast<double>(all_gyros)
                         : options_.grows ? 0.0
                                          : 1.0;
    return std::clamp(share, 0.0, 1.0);
}

void Progress::update() {
    const bool look = now_ - looked_ >= bar_interval;
    if (look) {
        looked_ = now_;
        left_s_ = time_left_.seconds(now_s());
    }
    const bool due = terminal_ ? look : now_ - shown_ >= line_interval;
    if (due || !any_shown_) show(false);
}

Progress::Pace Progress::pace() {
    const std::lock_guard lock(mutex_);
    read_clock();
    if (!stage_.empty()) return {gyros_, time_left_.turns_per_s(now_s()), std::nullopt};
    return {gyros_, time_left_.turns_per_s(now_s()), time_left_.seconds(now_s())};
}

void Progress::show(bool last) {
    if (options_.quiet) return;
    const auto [gyros, turns] = done();
    // Cut off, not rounded: 100 % means that all is done.
    std::string status =
        fmt::format("{:3} %  {}/{} gyros", static_cast<int>(100.0 * share_done()), gyros, total().gyros);
    if (options_.grows && !last) status += fmt::format(", {} at most", total_gyros_);
    const double speed = time_left_.turns_per_s(now_s());
    const std::string rate = speed > 0.0 ? fmt::format("  {:.3g} turns/s", speed) : "";
    if (last) {
        status += rate + "  in " + duration(now_s());
    } else if (!stage_.empty()) {
        status += "  " + stage_;
    } else if (time_left_.setting_up()) {
        status += "  set-up";
    } else {
        status += rate;
        if (left_s_) status += fmt::format("  {} {}", duration(*left_s_), options_.grows ? "to the next look" : "left");
    }
    any_shown_ = true;
    shown_ = now_;
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
