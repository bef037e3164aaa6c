#include "analysis/allan/bounded_record.hpp"

#include <stdexcept>

namespace ringlock::allan {
namespace {

__extension__ using Wide = __int128;

/// a/b, b > 0, to the nearest whole number.
Wide nearest_quotient(Wide a, Wide b) {
    const Wide doubled = 2 * a + b;
    const Wide quotient = doubled / (2 * b);
    return doubled % (2 * b) < 0 ? quotient - 1 : quotient;
}

}  // namespace

BoundedRecord::BoundedRecord(std::int64_t total, std::int64_t most) : total_(total) {
    if (total < 1 || most < 2) throw std::invalid_argument("bounded record: a run of samples, and two of them to keep");
    while ((total - 1) / interval_ + 1 > most) interval_ *= 2;
    rows_.reserve(static_cast<std::size_t>((total - 1) / interval_ + 1));
}

void BoundedRecord::add(std::span<const simd::LaneCounts> counts) {
    const auto rows = static_cast<std::int64_t>(counts.size());
    if (rows > total_ - seen_) throw std::length_error("bounded record: more samples than were announced");
    for (std::int64_t i = (interval_ - seen_ % interval_) % interval_; i < rows; i += interval_) {
        rows_.push_back(counts[static_cast<std::size_t>(i)]);
    }
    seen_ += rows;
}

std::vector<double> BoundedRecord::phase(std::size_t lane, double unit_per_count) const {
    std::vector<double> out(rows_.size());
    if (rows_.size() < 2) return out;
    const auto wrapped_increment = [&](std::size_t i) {
        return static_cast<std::uint64_t>(rows_[i][lane]) - static_cast<std::uint64_t>(rows_[i - 1][lane]);
    };
    // Less the first increment: the line removes the part that all increments share, regardless of how often it wraps
    // round.
    const std::uint64_t first = wrapped_increment(1);
    const auto increment = [&](std::size_t i) { return static_cast<std::int64_t>(wrapped_increment(i) - first); };
    Wide total = 0;
    for (std::size_t i = 1; i < rows_.size(); ++i) total += increment(i);
    const Wide mean = nearest_quotient(total, static_cast<Wide>(rows_.size() - 1));
    Wide phase = 0;
    for (std::size_t i = 1; i < rows_.size(); ++i) {
        phase += increment(i) - mean;
        out[i] = static_cast<double>(phase) * unit_per_count;
    }
    return out;
}

}  // namespace ringlock::allan
