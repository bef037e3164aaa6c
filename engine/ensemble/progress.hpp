#pragma once
#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <ostream>
#include <string>

namespace ringlock::ensemble {

/// Where and how progress is shown. What is left empty is taken from the process: standard error, whether it is a
/// terminal, the monotonic clock, the width of the terminal.
struct ProgressOptions {
    using Clock = std::function<std::chrono::steady_clock::time_point()>;

    bool quiet = false;
    std::int64_t total_turns = 0;              ///< the share done is told by turns where given, else by gyros
    std::ostream* out = nullptr;               ///< with one given, is_terminal is as said below
    bool is_terminal = false;                  ///< read only when `out` is given
    Clock clock = {};                          ///< must not go back
    std::function<int()> terminal_width = {};  ///< columns; 0 or less: unknown
};

/// Shows how far a run is: on a terminal a bar updated in place a few times a second, elsewhere plain lines (the first,
/// one every 10 s at most, and the last), nothing when quiet.
///
/// All functions may be called from any thread. Output that fails is given up silently: it must not stop a run.
class Progress {
   public:
    explicit Progress(std::int64_t total_gyros, ProgressOptions options = {});
    /// Clears the bar of a run that did not finish; writes nothing elsewhere.
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    /// So many gyros more are done, and so many turns of the phase (half-cycles of the dither) more were propagated.
    void advance(std::int64_t gyros, std::int64_t turns);

    /// The run is over: clears the bar, or writes the last plain line. Later calls do nothing.
    void finish();

   private:
    using Time = std::chrono::steady_clock::time_point;

    double share_done() const;
    void show(Time now, bool last);
    void draw_bar(const std::string& status);
    void clear_bar();

    const std::int64_t total_;
    ProgressOptions options_;
    std::ostream* out_;
    bool terminal_;
    std::mutex mutex_;
    Time start_;
    Time shown_;
    std::int64_t gyros_ = 0;
    std::int64_t turns_ = 0;
    bool any_shown_ = false;
    bool bar_visible_ = false;
    bool finished_ = false;
};

}  // namespace ringlock::ensemble
