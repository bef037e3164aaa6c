#pragma once
#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <ostream>
#include <span>
#include <string>

#include "engine/ensemble/progress/observer.hpp"
#include "engine/ensemble/progress/time_left.hpp"

namespace ringlock::ensemble {

/// Where and how progress is shown. Empty fields are taken from the process: standard error, whether it is a terminal,
/// the monotonic clock, the width of the terminal.
struct ProgressOptions {
    using Clock = std::function<std::chrono::steady_clock::time_point()>;

    struct Done {
        std::int64_t gyros = 0;
        std::int64_t turns = 0;
    };

    bool quiet = false;
    std::int64_t total_turns = 0;  ///< the share done is counted in turns where given, else in gyros
    Done already_done = {};        ///< of the total by an earlier run: part of the share, not of the rate
    bool grows = false;  ///< the total is the most that it can come to; share and time are those to the next look
    std::ostream* out = nullptr;               ///< with one given, is_terminal is as said below
    bool is_terminal = false;                  ///< read only when `out` is given
    Clock clock = {};                          ///< a step back counts as no time
    std::function<int()> terminal_width = {};  ///< columns; 0 or less: unknown
};

/// Shows how far a run is: on a terminal a bar updated in place a few times a second, elsewhere plain lines (the first,
/// one every 10 s at most, and the last), nothing when quiet.
///
/// A line names the stage where that is not the simulation: the set-up, until a first block goes through its turns, and
/// the stages. Rate and time left are as TimeLeft has them: no set-up is in the rate.
///
/// All functions may be called from any thread. Output that fails is given up silently: it must not stop a run.
class Progress final : public Observer {
   public:
    explicit Progress(std::int64_t total_gyros, ProgressOptions options = {});
    /// Clears the bar of a run that did not finish; writes nothing elsewhere.
    ~Progress() override;
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    void stage(const std::string& name) override;
    void plan(std::span<const PlannedBlock> blocks, int threads) override;
    void enter(std::size_t block, BlockStage stage) override;
    void advance(std::size_t block, std::int64_t gyros, std::int64_t turns, bool tabulated) override;

    /// Present knowledge of the speed, shown or not.
    struct Pace {
        std::int64_t gyros = 0;        ///< finished in this run, by all its processes
        double turns_per_s = 0.0;      ///< 0: no turn was gone through yet
        std::optional<double> left_s;  ///< nothing until it can be trusted
    };
    Pace pace();

    /// The run is over: clears the bar, or writes the last plain line. Later calls do nothing.
    void finish();

   private:
    using Clock = std::chrono::steady_clock;

    void read_clock();
    double now_s() const { return std::chrono::duration<double>(now_).count(); }
    ProgressOptions::Done done() const;
    ProgressOptions::Done total() const;
    double share_done() const;
    void update();
    void show(bool last);
    void draw_bar(const std::string& status);
    void clear_bar();

    const std::int64_t total_gyros_;
    ProgressOptions options_;
    std::ostream* out_;
    bool terminal_;
    std::mutex mutex_;
    Clock::time_point read_;    ///< of the clock, last
    Clock::duration now_{};     ///< since the beginning
    Clock::duration shown_{};   ///< when a line was, last
    Clock::duration looked_{};  ///< when the time left was requested last
    std::int64_t gyros_ = 0;    ///< of this run
    std::int64_t turns_ = 0;
    ProgressOptions::Done planned_;  ///< all that was planned so far
    std::string stage_;              ///< empty: the simulation
    TimeLeft time_left_;
    std::optional<double> left_s_;  ///< at the last look
    bool any_shown_ = false;
    bool bar_visible_ = false;
    bool finished_ = false;
};

}  // namespace ringlock::ensemble
