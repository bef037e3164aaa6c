#include "analysis/record/arrays/array_column.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "analysis/record/arrays/joined_times.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {
namespace {

void hand_on(double value, const ArrayColumn& column, std::size_t element, SeriesRows& rows) {
    if (std::isnan(value)) {
        rows.missing();
    } else if (std::isfinite(value)) {
        rows.value(value);
    } else {
        throw InputError(fmt::format("{} is {}; every value must be finite; where it is not known, write NaN",
                                     column.place(element), value));
    }
}

void hand_on(std::int64_t value, const ArrayColumn&, std::size_t, SeriesRows& rows) { rows.count(value); }

void hand_on(std::uint64_t value, const ArrayColumn& column, std::size_t element, SeriesRows& rows) {
    constexpr std::int64_t largest = std::numeric_limits<std::int64_t>::max();
    if (value > static_cast<std::uint64_t>(largest)) {
        throw InputError(
            fmt::format("{} is {}; allowed are counts up to {}. Subtract a constant; "
                        "where it was a negative number, write signed integers",
                        column.place(element), value, largest));
    }
    rows.count(static_cast<std::int64_t>(value));
}

void place(double time, const ArrayColumn&, std::size_t element, SeriesRows& rows) { rows.time(time, element); }
void place(std::int64_t time, const ArrayColumn&, std::size_t element, SeriesRows& rows) { rows.time(time, element); }
void place(std::uint64_t time, const ArrayColumn& column, std::size_t element, SeriesRows& rows) {
    constexpr std::int64_t largest = std::numeric_limits<std::int64_t>::max();
    if (time > static_cast<std::uint64_t>(largest)) {
        throw InputError(fmt::format("{} is {}; allowed are times up to {}", column.place(element), time, largest));
    }
    rows.time(static_cast<std::int64_t>(time), element);
}

/// Times in whole numbers, such as nanoseconds, keep all their digits.
template <class T, class Time>
void read_array(ArrayColumn& column, ArrayColumn* time, SeriesRows& rows) {
    std::vector<T> values(SeriesRows::longest);
    std::vector<Time> times(time != nullptr ? SeriesRows::longest : 0);
    for (std::uint64_t first = 0; first < column.length(); first += SeriesRows::longest) {
        const auto count =
            static_cast<std::size_t>(std::min<std::uint64_t>(SeriesRows::longest, column.length() - first));
        column.read(first, std::span<T>(values.data(), count));
        if (time != nullptr) time->read(first, std::span<Time>(times.data(), count));
        for (std::size_t i = 0; i < count; ++i) {
            if (time != nullptr) place(times[i], *time, first + i, rows);
            hand_on(values[i], column, first + i, rows);
        }
    }
}

template <class T>
void read_array(ArrayColumn& column, ArrayColumn* time, SeriesRows& rows) {
    const ArrayColumn::Kind kind = time != nullptr ? time->kind() : ArrayColumn::Kind::real;
    switch (kind) {
        case ArrayColumn::Kind::real:
            return read_array<T, double>(column, time, rows);
        case ArrayColumn::Kind::whole:
            return read_array<T, std::int64_t>(column, time, rows);
        case ArrayColumn::Kind::whole_unsigned:
            return read_array<T, std::uint64_t>(column, time, rows);
    }
}

}  // namespace

std::string ArrayColumn::place(std::size_t element) const {
    return fmt::format("{}, element {} (counted from 0)", label(), element);
}

SeriesInfo stream_column(const SeriesRequest& request, ArrayColumn& column, ArrayColumn* time, const TakePiece& take) {
    if (column.length() == 0) throw InputError(fmt::format("{}: is empty", column.label()));
    SeriesRows rows(take);
    if (time != nullptr) {
        if (time->length() != column.length()) {
            throw InputError(fmt::format("{} has {} elements, {} has {}; must be as many times as values",
                                         time->label(), time->length(), printable(column.name()), column.length()));
        }
        const text::TimeUnit unit = text::time_unit(request.time_unit.value_or("s"));
        rows.set_grid(TimeGrid(
            request.rate_hz, [time](std::size_t element) { return time->place(element); }, unit));
    }
    switch (column.kind()) {
        case ArrayColumn::Kind::real:
            read_array<double>(column, time, rows);
            break;
        case ArrayColumn::Kind::whole:
            read_array<std::int64_t>(column, time, rows);
            break;
        case ArrayColumn::Kind::whole_unsigned:
            read_array<std::uint64_t>(column, time, rows);
            break;
    }
    SeriesInfo info = rows.finish();
    info.column = column.name();
    return info;
}

SeriesInfo stream_choice(const SeriesRequest& request, const Choice& choice,
                         const std::function<std::unique_ptr<ArrayColumn>(const Slice&)>& open, const TakePiece& take) {
    const std::unique_ptr<ArrayColumn> column = open(choice.column);
    std::unique_ptr<ArrayColumn> time = choice.time ? open(*choice.time) : nullptr;
    if (!choice.nanoseconds) return stream_column(request, *column, time.get(), take);
    if (request.time_unit.value_or("s") != "s") {
        throw InputError(fmt::format(
            "--time-unit {}: of the two columns of times the first has seconds, the second nanoseconds; leave the "
            "option out",
            *request.time_unit));
    }
    JoinedTimes joined(std::move(time), open(*choice.nanoseconds));
    SeriesRequest in_ns = request;
    in_ns.time_unit = "ns";
    return stream_column(in_ns, *column, &joined, take);
}

}  // namespace ringlock::record
