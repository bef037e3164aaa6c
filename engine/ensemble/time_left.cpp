#include "engine/ensemble/time_left.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace ringlock::ensemble {

namespace {

constexpr double least_measured_s = 2.0;
constexpr double longest_look_back_s = 30.0;
constexpr double between_looks_s = 0.1;
constexpr double agreement = std::numbers::sqrt2;
constexpr double rounding_s = 1.0;  ///< estimates that differ by no more agree
/// A block's own rate counts as much as that of all once it has gone on for so long.
constexpr double own_rate_s = 1.0;
/// With more blocks than this waiting for each thread, threads end at the same time as good as.
constexpr std::size_t many = 32;

}  // namespace

void TimeLeft::plan(std::span<const PlannedBlock> blocks, int threads) {
    const double turning_s = turning_s_;
    *this = {};
    turning_s_ = turning_s;
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
    switch (block.stage) {
        case BlockStage::set_up:
            if (block.begun) set_up_.add(now_s - block.since_s);
            break;
        case BlockStage::turns:
            measure(block, 0.0, now_s);
            if (--turning_ == 0) turning_s_ += now_s - turning_since_s_;
            break;
        case BlockStage::output:
            output_.add(now_s - block.since_s);
            break;
        case BlockStage::over:
            break;
    }
    if (!block.begun) {
        block.begun = true;
        waiting_work_ -= block.work;
        --waiting_;
        active_.push_back(number);
    }
    block.stage = stage;
    block.since_s = now_s;
    if (stage == BlockStage::turns) {
        if (!origin_s_) origin_s_ = now_s;
        if (turning_++ == 0) turning_since_s_ = now_s;
    }
    if (stage == BlockStage::over) std::erase(active_, number);
}

void TimeLeft::advance(std::size_t number, std::int64_t turns, double now_s) {
    Block& block = blocks_.at(number);
    const double work = block.per_turn * static_cast<double>(turns);
    block.left = std::max(0.0, block.left - work);
    if (block.stage == BlockStage::turns) measure(block, work, now_s);
}

void TimeLeft::measure(Block& block, double work, double now_s) {
    const double weight = now_s - *origin_s_;
    const double time_s = now_s - block.since_s;
    block.since_s = now_s;
    for (Rate* rate : {&block.measured, &measured_}) {
        rate->work += weight * work;
        rate->time_s += weight * time_s;
    }
}

double TimeLeft::left_of_s(const Block& block, double now_s) const {
    const double at_stage_s = now_s - block.since_s;
    switch (block.stage) {
        case BlockStage::set_up: {
            const double set_up_s = std::max(0.0, set_up_.value_s() - at_stage_s);
            return set_up_s + block.left * measured_.time_s / measured_.work + output_.value_s();
        }
        case BlockStage::turns: {
            const double others_s = own_rate_s * (now_s - *origin_s_);  // weighted as what is measured
            const double work = block.measured.work + others_s * measured_.work / measured_.time_s;
            const double time_s = block.measured.time_s + others_s;
            return std::max(0.0, block.left * time_s / work - at_stage_s) + output_.value_s();
        }
        case BlockStage::output:
            return std::max(0.0, output_.value_s() - at_stage_s);
        case BlockStage::over:
            break;
    }
    return 0.0;
}

std::optional<double> TimeLeft::estimate_s(double now_s) const {
    if (!(measured_.work > 0.0 && measured_.time_s > 0.0)) return std::nullopt;
    std::vector<double> free_in_s;  // of each thread
    double sum_s = 0.0;
    for (const std::size_t number : active_) {
        free_in_s.push_back(left_of_s(blocks_[number], now_s));
        sum_s += free_in_s.back();
    }
    free_in_s.resize(std::max(threads_, free_in_s.size()), 0.0);
    const double fixed_s = set_up_.value_s() + output_.value_s();
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
