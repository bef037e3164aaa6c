#pragma once
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "engine/ensemble/progress/observer.hpp"

namespace ringlock::ensemble {

/// Time that a simulation will still take, and its speed, from the times of its blocks so far.
///
/// Three times of each block are measured: that of its preparation (set-up, and turns during which turn maps were
/// tabulated), of its other turns, and of its output. A block that goes through its turns is taken to go on as it does;
/// one that waits, to take the mean of those before it. Waiting blocks are given to the thread that is free first, as
/// they are when they run: threads without work towards the end are thus included.
///
/// Rates weight each measurement by the time since the turns began, so that the influence of a slow start decreases as
/// the run goes on. An estimate is given once it can be trusted: when turns have gone on for some seconds, and the
/// estimates at all times in the last half of these (at most the last 5 s) agree with the present one within a factor
/// of the root of 2. A longer comparison would suppress more estimates on a machine with other work, and would not
/// improve them.
///
/// Times are seconds of any clock that does not go back.
class TimeLeft {
   public:
    /// These blocks come next; measurements of other blocks are discarded, except for the speed.
    void plan(std::span<const PlannedBlock> blocks, int threads);
    void enter(std::size_t block, BlockStage stage, double now_s);
    void advance(std::size_t block, std::int64_t turns, bool tabulated, double now_s);

    /// Seconds until all blocks are over; nothing while that is not known well. To be called a few times a second, as
    /// the estimates are compared with each other.
    std::optional<double> seconds(double now_s);
    /// No block has gone through turns without tabulating turn maps, or nothing is planned.
    bool setting_up() const { return !origin_s_; }
    /// Turns a second of as many threads as were at work in the mean, preparations left out; 0 where none is known.
    double turns_per_s(double now_s) const;

   private:
    /// Sums over measured pieces, each weighted by the time at which it ended.
    struct Rate {
        double work = 0.0;
        double time_s = 0.0;
    };
    struct Mean {
        double sum_s = 0.0;
        int count = 0;
        void add(double time_s) {
            sum_s += time_s;
            ++count;
        }
        double value_s() const { return count > 0 ? sum_s / count : 0.0; }
    };
    struct Block {
        double work = 0.0;      ///< of all its turns
        double per_turn = 0.0;  ///< work of one reported turn
        double left = 0.0;      ///< work
        double since_s = 0.0;   ///< when its stage began, or its last turn was reported
        double prepared_s = 0.0;
        Rate measured = {};
        BlockStage stage = BlockStage::over;
        bool begun = false;
    };
    struct Past {
        double at_s;
        double left_s;
    };
    /// Speed over all plans, without weights.
    struct Speed {
        double turns = 0.0;
        double turns_s = 0.0;  ///< time of threads in these turns
        double busy_s = 0.0;   ///< time of threads in blocks, up to `counted_s`
        double run_s = 0.0;    ///< time in which there was any
        double counted_s = 0.0;
    };

    std::optional<double> estimate_s(double now_s) const;
    double preparation_s() const;
    double left_of_s(const Block& block, double preparation_s, double now_s) const;
    void measure(Block& block, std::int64_t turns, double now_s);
    Speed speed_until(double now_s) const;

    std::vector<Block> blocks_;
    std::size_t threads_ = 1;
    std::vector<std::size_t> active_;  ///< blocks that have begun and are not over
    std::size_t waiting_ = 0;          ///< blocks that have not begun
    double waiting_work_ = 0.0;
    std::optional<double> origin_s_;  ///< of weights: when the first turns that were measured began
    Rate measured_;
    Mean preparation_;  ///< of blocks that are over
    Mean output_;
    std::deque<Past> past_;
    Speed speed_;
};

}  // namespace ringlock::ensemble
