#pragma once
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "engine/ensemble/observer.hpp"

namespace ringlock::ensemble {

/// Time that a simulation will still take, from what its blocks have taken so far.
///
/// What is measured of each block: the time of its set-up, of its turns, of its output. A block that goes through its
/// turns is taken to go on as it does; one that waits, to take the mean of those before it. Waiting blocks are given to
/// the thread that is free first, as they are when they run: threads without work towards the end are so accounted for.
///
/// Rates weight what was measured by the time since the turns began, so that a slow start is forgotten in proportion as
/// the run goes on. An estimate is given once it can be trusted: when turns have gone on for some seconds, and what it
/// would have said at any time in the last half of these (at most the last half minute) agrees with what is known now
/// within a factor of the root of 2.
///
/// Times are seconds of any clock that does not go back.
class TimeLeft {
   public:
    /// These blocks come next; what was measured of others is forgotten.
    void plan(std::span<const PlannedBlock> blocks, int threads);
    void enter(std::size_t block, BlockStage stage, double now_s);
    void advance(std::size_t block, std::int64_t turns, double now_s);

    /// Seconds until all blocks are over; nothing while that is not known well. To be asked some times a second, as the
    /// estimates are compared with each other.
    std::optional<double> seconds(double now_s);
    /// No block has gone through a turn: turn maps are tabulated, or nothing is planned.
    bool setting_up() const { return !origin_s_; }
    /// Time in which at least one block went through its turns.
    double turning_s(double now_s) const { return turning_s_ + (turning_ > 0 ? now_s - turning_since_s_ : 0.0); }

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
        double per_turn = 0.0;  ///< work of one turn told
        double left = 0.0;      ///< work
        double since_s = 0.0;   ///< when its stage began, or its last turn was told
        Rate measured = {};
        BlockStage stage = BlockStage::over;
        bool begun = false;
    };
    struct Past {
        double at_s;
        double left_s;
    };

    std::optional<double> estimate_s(double now_s) const;
    double left_of_s(const Block& block, double now_s) const;
    void measure(Block& block, double work, double now_s);

    std::vector<Block> blocks_;
    std::size_t threads_ = 1;
    std::vector<std::size_t> active_;  ///< blocks that have begun and are not over
    std::size_t waiting_ = 0;          ///< blocks that have not begun
    double waiting_work_ = 0.0;
    std::size_t turning_ = 0;  ///< blocks that go through their turns
    double turning_since_s_ = 0.0;
    double turning_s_ = 0.0;          ///< but for that since then
    std::optional<double> origin_s_;  ///< of weights: when the first turns began
    Rate measured_;
    Mean set_up_;
    Mean output_;
    std::deque<Past> past_;
};

}  // namespace ringlock::ensemble
