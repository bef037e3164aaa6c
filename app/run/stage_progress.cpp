#include "app/run/stage_progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include "app/output.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {

namespace {

double seconds(std::chrono::steady_clock::duration since) { return std::chrono::duration<double>(since).count(); }

}  // namespace

StageProgress::StageProgress(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {
    if (!quiet_ && terminal_) ticking_ = std::jthread([this](const std::stop_token& stop) { tick(stop); });
}

StageProgress::~StageProgress() {
    if (ticking_.joinable()) {
        ticking_.request_stop();
        ticking_.join();
    }
    if (shown_ && terminal_) draw_over("\r\033[K");
}

void StageProgress::show(const std::string& stage) {
    const std::lock_guard lock(mutex_);
    stage_ = stage;
    first_.reset();
    draw();
}

void StageProgress::show_share(double share) {
    const std::lock_guard lock(mutex_);
    share_ = share;
    if (!first_) first_ = {Clock::now(), share};
    if (terminal_ || Clock::now() - drawn_ > std::chrono::seconds(10)) draw();
}

/// Nothing before a tenth of the parts and two seconds have shown how long they take.
std::optional<double> StageProgress::left_s() const {
    if (!first_ || share_ - first_->share < 0.1) return std::nullopt;
    const double since_s = seconds(Clock::now() - first_->at);
    if (since_s < 2.0) return std::nullopt;
    return since_s * (1.0 - share_) / (share_ - first_->share);
}

void StageProgress::draw() {
    if (quiet_ || stage_.empty()) return;
    std::string line = fmt::format("{:4.0f} s  {}", seconds(Clock::now() - start_), stage_);
    if (const auto left = left_s()) line += fmt::format(", {:.0f} %, about {:.0f} s left", 100.0 * share_, *left);
    draw_over(terminal_ ? "\r\033[K" + printable(line) + " ..." : printable(line) + "\n");
    drawn_ = Clock::now();
    shown_ = true;
}

/// Updates the shown time where the loop reports nothing for long.
void StageProgress::tick(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
        ticked_.wait_for(lock, stop, std::chrono::seconds(1), [] { return false; });
        if (!stop.stop_requested()) draw();
    }
}

}  // namespace ringlock::app
