#pragma once
#include <atomic>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <mutex>
#include <string>

namespace ringlock::ensemble {

struct ProgressOptions {
    bool quiet = false;            ///< say nothing
    std::int64_t total_turns = 0;  ///< the share done is told by turns where given, else by gyros
};

/// Where progress is shown and how that place behaves.
struct ProgressSink {
    std::ostream* stream;
    bool terminal;
    std::function<int()> columns;   ///< width of the terminal
    std::function<double()> now_s;  ///< monotonic time [s]

    /// Standard error: a terminal if it is one and can move its cursor.
    static ProgressSink standard_error();
};

/// Tells how far an ensemble is: share and number of gyros done, turns per second, time left.
///
/// On a terminal a bar, updated in place a few times a second; elsewhere plain lines, the first at once, then at most
/// one every 10 s, and the last.
class Progress {
   public:
    Progress(std::int64_t total_gyros, ProgressOptions options)
        : Progress(total_gyros, options, ProgressSink::standard_error()) {}
    Progress(std::int64_t total_gyros, ProgressOptions options, ProgressSink sink);
    /// Clears the line of a terminal where finish() has not, so that an error message stands alone.
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    /// Counts what was done since the last call. From any thread; never waits for another thread that is writing.
    void advance(std::int64_t gyros, std::int64_t turns);
    /// Clears the line of a terminal, writes the last plain line elsewhere.
    void finish();

   private:
    void show(double now_s);
    void show_bar(double elapsed_s);
    void show_line(double elapsed_s);
    void clear_line();
    double share_done() const;

    const std::int64_t total_gyros_;
    const ProgressOptions options_;
    const ProgressSink sink_;
    const double start_s_;
    std::atomic<std::int64_t> gyros_{0};
    std::atomic<std::int64_t> turns_{0};
    std::mutex output_mutex_;  // guards the stream and what follows
    double last_shown_s_ = 0.0;
    bool bar_on_screen_ = false;
};

}  // namespace ringlock::ensemble
