#include "engine/ensemble/progress/time_left.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace ringlock::ensemble {

namespace {

constexpr double least_measured_s = 2.0;
constexpr double longest_look_back_s = 5.0;
constexpr double between_looks_s = 0.1;
constexpr double agreement = std::numbers::sqrt2;
constexpr double rounding_s = 1.0;  ///< estimates that differ by no more agree
/// Time after which a block's own rate has the same weight as that of all blocks.
constexpr double own_rate_s = 1.0;
/// With more blocks than this waiting for each thread, threads end at the same time as good as.
constexpr std::size_t many = 32;

}  // namespace

void TimeLeft::plan(std::span<const PlannedBlock> blocks, int threads) {
    const Speed speed = speed_;
    *this = {};
    speed_ = speed;
    threads_ = static_cast<std::size_t>(std::max(1, threads));
    blocks_.reserve(blocks.size());
    for (const PlannedBlock& planned : blocks) {
        // The gyros of a block go side by side: a block of few takes as long as one of many.
        const double per_turn = planned.gyros > 0 ? 1.0 / static_cast<double>(planned.gyros) : 0.0;
        const double work = per_turn * static_cast<double>(planned.turns);
        blocks_.push_back({.work = work, .per_turn = per_turn, .left = work});
        waiting_work_ += work;
    }
    waiting_ = blocks_.size();
}

void TimeLeft::enter(std::size_t number, BlockStage stage, double now_s) {
    Block& block = blocks_.at(number);
    speed_ = speed_until(now_s);
    if (!block.begun) {
        block.begun = true;
        waiting_work_ -= block.work;
        --waiting_;
        active_.push_back(number);
    } else if (block.stage == BlockStage::set_up) {
        block.prepared_s += now_s - block.since_s;
    } else if (block.stage == BlockStage::output) {
        output_.add(now_s - block.since_s);
    }
    block.stage = stage;
    block.since_s = now_s;
    if (stage == BlockStage::over) {
        preparation_.add(block.prepared_s);
        std::erase(active_, number);
    }
}

void TimeLeft::advance(std::size_t number, std::int64_t turns, bool tabulated, double now_s) {
    Block& block = blocks_.at(number);
    if (block.stage == BlockStage::turns) {
        if (tabulated) {
            block.prepared_s += now_s - block.since_s;
        } else {
            measure(block, turns, now_s);
        }
        block.since_s = now_s;
    }
    block.left = std::max(0.0, block.left - block.per_turn * static_cast<double>(turns));
}

void TimeLeft::measure(Block& block, std::int64_t turns, double now_s) {
    if (!origin_s_) origin_s_ = block.since_s;
    const double weight = now_s - *origin_s_;
    const double time_s = now_s - block.since_s;
    for (Rate* rate : {&block.measured, &measured_}) {
        rate->work += weight * block.per_turn * static_cast<double>(turns);
        rate->time_s += weight * time_s;
    }
    speed_.turns += static_cast<double>(turns);
    speed_.turns_s += time_s;
}

TimeLeft::Speed TimeLeft::speed_until(double now_s) const {
    Speed speed = speed_;
    const double time_s = now_s - speed.counted_s;
    speed.busy_s += time_s * static_cast<double>(active_.size());
    speed.run_s += active_.empty() ? 0.0 : time_s;
    speed.counted_s = now_s;
    return speed;
}

double TimeLeft::turns_per_s(double now_s) const {
    const Speed speed = speed_until(now_s);
    if (!(speed.turns_s > 0.0 && speed.run_s > 0.0)) return 0.0;
    return speed.turns / speed.turns_s * (speed.busy_s / speed.run_s);
}

double TimeLeft::preparation_s() const {
    if (preparation_.count > 0) return preparation_.value_s();
    Mean begun;  // the least that it can be
    for (const std::size_t number : active_) {
        if (blocks_[number].stage != BlockStage::set_up) begun.add(blocks_[number].prepared_s);
    }
    return begun.value_s();
}

double TimeLeft::left_of_s(const Block& block, double preparation_s, double now_s) const {
    const double at_stage_s = now_s - block.since_s;
    if (block.stage == BlockStage::output) return std::max(0.0, output_.value_s() - at_stage_s);
    if (block.stage == BlockStage::set_up) {
        return std::max(0.0, preparation_s - at_stage_s) + block.left * measured_.time_s / measured_.work +
               output_.value_s();
    }
    const double others_s = own_rate_s * (now_s - *origin_s_);  // weighted like the measured work
    const double work = block.measured.work + others_s * measured_.work / measured_.time_s;
    const double time_s = block.measured.time_s + others_s;
    return std::max(0.0, preparation_s - block.prepared_s) + std::max(0.0, block.left * time_s / work - at_stage_s) +
           output_.value_s();
}

std::optional<double> TimeLeft::estimate_s(double now_s) const {
    if (!(measured_.work > 0.0 && measured_.time_s > 0.0)) return std::nullopt;
    const double preparation = preparation_s();
    std::vector<double> free_in_s;  // of each thread
    double sum_s = 0.0;
    for (const std::size_t number : active_) {
        free_in_s.push_back(left_of_s(blocks_[number], preparation, now_s));
        sum_s += free_in_s.back();
    }
    free_in_s.resize(std::max(threads_, free_in_s.size()), 0.0);
    const double fixed_s = preparation + output_.value_s();
    const double s_per_work = measured_.time_s / measured_.work;
    if (waiting_ > many * threads_) {
        return (sum_s + static_cast<double>(waiting_) * fixed_s + waiting_work_ * s_per_work) /
               static_cast<double>(threads_);
    }
    std::make_heap(free_in_s.begin(), free_in_s.end(), std::greater());
    for (std::size_t i = 0, found = 0; found < waiting_; ++i) {
        if (blocks_[i].begun) continue;
        ++found;
        std::pop_heap(free_in_s.begin(), free_in_s.end(), std::greater());
        free_in_s.back() += fixed_s + blocks_[i].work * s_per_work;
        std::push_heap(free_in_s.begin(), free_in_s.end(), std::greater());
    }
    return *std::max_element(free_in_s.begin(), free_in_s.end());
}

std::optional<double> TimeLeft::seconds(double now_s) {
    const std::optional<double> left_s = estimate_s(now_s);
    if (!left_s) return std::nullopt;
    if (past_.empty() || now_s - past_.back().at_s >= between_looks_s) past_.push_back({now_s, *left_s});
    const double measured_s = now_s - *origin_s_;
    const double from_s = now_s - std::min(measured_s / 2.0, longest_look_back_s);
    while (!past_.empty() && past_.front().at_s < from_s) past_.pop_front();
    if (measured_s < least_measured_s) return std::nullopt;
    const bool agree = std::all_of(past_.begin(), past_.end(), [&](const Past& past) {
        const double known_now_s = now_s - past.at_s + *left_s;
        return std::abs(past.left_s - known_now_s) <= rounding_s ||
               (past.left_s <= agreement * known_now_s && known_now_s <= agreement * past.left_s);
    });
    const bool overdue = *left_s <= 0.0;
    return agree && !overdue ? left_s : std::nullopt;
}

}  // namespace ringlock::ensemble
