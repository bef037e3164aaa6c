#include "analysis/record/series/text_times.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/text/columns.hpp"
#include "analysis/text/numbers.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/notice.hpp"

namespace ringlock::record {
namespace {

constexpr double ns_s = 1e-9;

/// Splits "sec,nsec" into two names, unless a column has that name.
std::vector<std::string> parts_of(const text::Layout& layout, const std::string& asked) {
    for (const text::Column& column : layout.columns) {
        if (column.heading == asked || column.name == asked) return {asked};
    }
    const std::size_t comma = asked.find(',');
    if (comma == std::string::npos) return {asked};
    return {std::string(text::trimmed(asked.substr(0, comma))), std::string(text::trimmed(asked.substr(comma + 1)))};
}

}  // namespace

TextTimes::TextTimes(const text::Layout& layout, const std::vector<std::string_view>& first,
                     const SeriesRequest& request, std::string file)
    : file_(std::move(file)) {
    for (const std::string& part : parts_of(layout, *request.time)) {
        where_.push_back(text::find_column(layout, part, file_));
        names_.push_back(text::shown(layout.columns[where_.back()].heading));
        name_ += (name_.empty() ? "" : ",") + names_.back();
    }
    if (where_.size() > 1 && where_[0] == where_[1]) {
        throw InputError(fmt::format("{}: --time {}: names one column twice; seconds and nanoseconds are two columns",
                                     file_, text::shown(*request.time)));
    }
    find_unit(layout, first, request);
}

void TextTimes::find_unit(const text::Layout& layout, const std::vector<std::string_view>& first,
                          const SeriesRequest& request) {
    if (request.time_unit) {
        unit_ = text::time_unit(*request.time_unit);
    } else if (!first.empty() && text::is_iso_date(first[where_[0]])) {
        unit_ = text::time_unit("iso");
        return;
    }
    if (where_.size() > 1) {
        const text::Column& second = layout.columns[where_[1]];
        const auto of_second = text::declared_time_unit(second.name, second.unit);
        if (!unit_.iso && of_second && of_second->name != "ns") {
            throw InputError(
                fmt::format("{}:{}: column {} declares its times to be in {}; of two columns of times the second must "
                            "hold nanoseconds or times of day. Where it is a time by itself, name it alone",
                            file_, layout.line(), names_[1], of_second->name));
        }
        if (unit_.name == "s" || unit_.iso) return;
        throw InputError(
            fmt::format("{}: --time-unit {}: the first of the two columns {} must hold seconds or dates, "
                        "the second nanoseconds or times of day",
                        file_, unit_.name, name_));
    }
    const text::Column& column = layout.columns[where_[0]];
    const auto declared = text::declared_time_unit(column.name, column.unit);
    if (!declared || unit_.iso) return;
    if (!request.time_unit) {
        unit_ = *declared;
        if (unit_.seconds != 1.0 && !request.text.quiet) {
            notice(fmt::format("note: {}: column {} declares its times to be in {}; --time-unit says otherwise", file_,
                               name_, unit_.name));
        }
    } else if (unit_ != *declared) {
        throw InputError(
            fmt::format("{}:{}: column {} declares its times to be in {}, which contradicts --time-unit {}; "
                        "leave the option out, or correct the header",
                        file_, layout.line(), name_, declared->name, unit_.name));
    }
}

bool TextTimes::has(std::size_t column) const {
    return std::find(where_.begin(), where_.end(), column) != where_.end();
}

void TextTimes::fail(const text::Table& table, std::size_t column, const std::string& what) const {
    throw InputError(fmt::format("{}:{}: column {}: {}", file_, table.line(), names_[column], what));
}

text::Stamp TextTimes::of(const text::Table& table) const {
    return where_.size() == 1 ? of_one(table, 0) : of_two(table);
}

text::Stamp TextTimes::of_one(const text::Table& table, std::size_t column) const {
    const std::string_view field = table.fields()[where_[column]];
    text::Stamp stamp;
    if (text::parse_stamp(field, unit_.iso, table.layout().dialect.decimal_comma, stamp)) return stamp;
    if (unit_.iso) {
        fail(table, column,
             fmt::format("'{}' is not a date such as 2024-05-01T12:00:00.5Z, but the other times are dates",
                         text::shown(field)));
    }
    fail(table, column,
         fmt::format("'{}' is not a number; times must be numbers of seconds, of the unit of --time-unit, "
                     "or ISO dates (2024-05-01T12:00:00.5Z)",
                     text::shown(field)));
}

text::Stamp TextTimes::of_two(const text::Table& table) const {
    const std::string_view second = table.fields()[where_[1]];
    if (unit_.iso) {
        text::Stamp stamp;
        const std::string both = fmt::format("{} {}", table.fields()[where_[0]], second);
        if (text::parse_stamp(both, true, false, stamp)) return stamp;
        fail(table, 0,
             fmt::format("'{}' is not a date and time of day such as 2024-05-01 12:00:00.5", text::shown(both)));
    }
    text::Stamp stamp = of_one(table, 0);
    text::Stamp nanoseconds;
    constexpr double in_a_second = 1e9;
    if (!text::parse_stamp(second, false, table.layout().dialect.decimal_comma, nanoseconds)) {
        fail(table, 1, fmt::format("'{}' is not a number of nanoseconds", text::shown(second)));
    }
    const double value = nanoseconds.value();
    if (value < 0.0 || value >= in_a_second) {
        fail(table, 1,
             fmt::format("is {}; nanoseconds next to a column of seconds must be from 0 to 999999999",
                         text::shown(second)));
    }
    stamp.part += value * ns_s;  // NaN where they are missing
    return stamp;
}

}  // namespace ringlock::record
