#include "analysis/record/arrays/joined_times.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "engine/core/error.hpp"

namespace ringlock::record {
namespace {

constexpr std::int64_t ns_in_second = 1'000'000'000;

/// Elements as doubles, in which whole seconds and nanoseconds are exact.
std::vector<double> whole_numbers(ArrayColumn& column, std::uint64_t first, std::size_t count, double low,
                                  double high) {
    std::vector<double> out(count);
    column.read(first, std::span<double>(out));
    for (std::size_t i = 0; i < count; ++i) {
        if (out[i] >= low && out[i] <= high && out[i] == std::trunc(out[i])) continue;
        throw InputError(fmt::format(
            "{} is {}; of two columns of times the first has whole seconds, the second nanoseconds from 0 to {}",
            column.place(static_cast<std::size_t>(first) + i), out[i], ns_in_second - 1));
    }
    return out;
}

}  // namespace

JoinedTimes::JoinedTimes(std::unique_ptr<ArrayColumn> seconds, std::unique_ptr<ArrayColumn> nanoseconds)
    : seconds_(std::move(seconds)), nanoseconds_(std::move(nanoseconds)) {
    if (seconds_->length() == nanoseconds_->length()) return;
    throw InputError(fmt::format("{} has {} elements, {} has {}; must be as many nanoseconds as seconds",
                                 seconds_->label(), seconds_->length(), nanoseconds_->name(), nanoseconds_->length()));
}

void JoinedTimes::read(std::uint64_t first, std::span<std::int64_t> into) {
    const double most_seconds = static_cast<double>(std::numeric_limits<std::int64_t>::max() / ns_in_second - 1);
    const auto seconds = whole_numbers(*seconds_, first, into.size(), -most_seconds, most_seconds);
    const auto rest = whole_numbers(*nanoseconds_, first, into.size(), 0.0, static_cast<double>(ns_in_second - 1));
    for (std::size_t i = 0; i < into.size(); ++i) {
        into[i] = static_cast<std::int64_t>(seconds[i]) * ns_in_second + static_cast<std::int64_t>(rest[i]);
    }
}

void JoinedTimes::read(std::uint64_t first, std::span<double> into) {
    std::vector<std::int64_t> whole(into.size());
    read(first, std::span<std::int64_t>(whole));
    for (std::size_t i = 0; i < into.size(); ++i) into[i] = static_cast<double>(whole[i]);
}

void JoinedTimes::read(std::uint64_t first, std::span<std::uint64_t> into) {
    std::vector<std::int64_t> whole(into.size());
    read(first, std::span<std::int64_t>(whole));
    for (std::size_t i = 0; i < into.size(); ++i) into[i] = static_cast<std::uint64_t>(whole[i]);
}

}  // namespace ringlock::record
