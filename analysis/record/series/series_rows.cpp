#include "analysis/record/series/series_rows.hpp"

#include <algorithm>

#include "engine/core/interrupt.hpp"

namespace ringlock::record {

void SeriesRows::fill(const StampedRow& at) {
    for (std::size_t steps = grid_->steps_to(at.stamp, at.row); steps > 1; --steps) leave_out();
}

bool SeriesRows::place(const Waiting& row) {
    stamped_ = false;
    if (begun_) {
        fill(stamp_);
        return true;
    }
    waiting_.push_back(row);
    waiting_.back().at = stamp_;
    if (waiting_.size() == TimeGrid::first_rows) begin_grid();
    return false;
}

void SeriesRows::begin_grid() {
    std::vector<StampedRow> first;
    for (const Waiting& row : waiting_) first.push_back(row.at);
    grid_->begin(first);
    begun_ = true;
    for (const Waiting& row : waiting_) {
        fill(row.at);
        line_ = row.line;
        if (row.kind == Waiting::Kind::value) {
            value(row.value);
        } else if (row.kind == Waiting::Kind::count) {
            count(row.count);
        } else {
            missing();
        }
    }
    waiting_.clear();
}

void SeriesRows::make_room() {
    if (values_.size() == longest) {
        flush();
        return;
    }
    // Small files pay for small buffers only.
    const std::size_t size = std::min(8 * values_.size(), longest);
    values_.resize(size);
    counts_.resize(size);
}

void SeriesRows::flush() {
    check_interrupt();
    const std::span<const double> values(values_.data(), filled_);
    const std::span<const std::int64_t> counts(counts_.data(), all_whole_ ? filled_ : 0);
    info_.n += filled_;
    filled_ = 0;
    take_({values, counts});
}

SeriesInfo SeriesRows::finish() {
    if (grid_ && !begun_) begin_grid();
    if (grid_) grid_->check_rate();
    if (filled_ > 0) flush();
    info_.rounded = all_whole_ && beyond_doubles_;
    return info_;
}

}  // namespace ringlock::record
