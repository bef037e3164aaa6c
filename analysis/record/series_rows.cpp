#include "analysis/record/series_rows.hpp"

#include "engine/core/interrupt.hpp"

namespace ringlock::record {

void SeriesRows::time(double time_s, std::size_t row) {
    for (std::size_t steps = grid_->steps_to(time_s, row); steps > 1; --steps) missing();
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
    if (grid_) grid_->check_rate();
    if (filled_ > 0) flush();
    info_.rounded = all_whole_ && beyond_doubles_;
    return info_;
}

}  // namespace ringlock::record
