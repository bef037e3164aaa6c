#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>

#include "analysis/record/readers.hpp"
#include "analysis/record/text_lines.hpp"
#include "engine/core/error.hpp"

namespace ringlock::record {
namespace {

/// Missing, in words that no number parser knows.
bool is_not_available(std::string_view field) {
    if (field.size() == 3 && (field[0] == '+' || field[0] == '-')) field.remove_prefix(1);
    return field.size() == 2 && (field[0] | 0x20) == 'n' && (field[1] | 0x20) == 'a';
}

/// A number, or NaN where it is missing.
bool parse_value(std::string_view field, double& value) {
    if (field.empty() || is_not_available(field)) {
        value = std::numeric_limits<double>::quiet_NaN();
        return true;
    }
    return parse_number(field, value);
}

class TextReader {
   public:
    TextReader(const SeriesRequest& request, const TakePiece& take)
        : file_(name_of_file(request.path)), request_(request), rows_(take) {}

    void line(std::string_view text) {
        ++number_;
        if (number_ == 1) text = without_mark(text);
        if (const std::size_t hash = text.find('#'); hash != std::string_view::npos) {
            if (trimmed(text.substr(0, hash)).empty()) attribute(trimmed(text.substr(hash + 1)));
            text = text.substr(0, hash);
        }
        text = trimmed(text);
        if (text.empty()) return;
        if (columns_ == 0) {
            if (first_row(text)) return;
        }
        row(text);
    }

    SeriesInfo finish() {
        if (only_whole_ && !too_large_.empty()) throw InputError(too_large_);
        SeriesInfo info = rows_.finish();
        if (info.n == 0) {
            throw InputError(
                fmt::format("{}: holds no data (lines read: {}); rows of numbers are needed", file_, number_));
        }
        info.column = column_;
        info.rate_hz = rate_hz_;
        return info;
    }

   private:
    std::string place(std::size_t line) const { return fmt::format("{}:{}", file_, line); }

    std::string_view without_mark(std::string_view text) const {
        if (text.starts_with("\x89HDF")) {
            throw InputError(fmt::format("{}: is HDF5, which cannot be read from a stream; name the file", file_));
        }
        if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
        return text;
    }

    void attribute(std::string_view text) {
        const std::size_t equals = text.find('=');
        if (equals == std::string_view::npos || trimmed(text.substr(0, equals)) != "rate_hz") return;
        const std::string_view value = trimmed(text.substr(equals + 1));
        double rate = 0.0;
        if (!parse_number(value, rate) || !(rate > 0.0) || !std::isfinite(rate)) {
            throw InputError(
                fmt::format("{}: rate_hz = '{}': must be a positive number", place(number_), shown(value)));
        }
        rate_hz_ = rate;
    }

    /// Looks at the first row; true where it is a header.
    bool first_row(std::string_view text) {
        commas_ = text.find(',') != std::string_view::npos;
        std::vector<std::string> names;
        bool numbers = true;
        std::string_view field;
        double value = 0.0;
        for (Fields fields(text, commas_); fields.next(field);) {
            names.push_back(shown(field));
            numbers = numbers && parse_value(field, value);
        }
        columns_ = names.size();
        if (numbers) {
            for (std::size_t i = 0; i < names.size(); ++i) names[i] = std::to_string(i + 1);
        }
        choose(names, numbers ? fmt::format("columns have no names and are numbered 1 to {}", names.size())
                              : fmt::format("columns are {}", listed(names)));
        return !numbers;
    }

    /// `there`: for a message, what columns there are.
    void choose(const std::vector<std::string>& names, const std::string& there) {
        if (request_.time) {
            time_column_ = find(names, *request_.time, there);
            time_name_ = names[time_column_];
            rows_.set_grid(TimeGrid(request_.rate_hz, [this](std::size_t line) {
                return fmt::format("{}: column {}", place(line), time_name_);
            }));
        }
        if (request_.column) {
            value_column_ = find(names, *request_.column, there);
        } else if (names.size() == (request_.time ? 2 : 1)) {
            value_column_ = time_column_ == 0 ? 1 : 0;
        } else {
            throw InputError(fmt::format("{}: has {} {}{}; say which with --column ({})", place(number_), names.size(),
                                         names.size() == 1 ? "column" : "columns",
                                         request_.time ? fmt::format(", of which {} is the time", time_name_) : "",
                                         there));
        }
        column_ = names[value_column_];
    }

    std::size_t find(const std::vector<std::string>& names, const std::string& asked, const std::string& there) const {
        for (std::size_t i = 0; i < names.size(); ++i) {
            if (names[i] == asked) return i;
        }
        std::size_t index = 0;
        const char* last = asked.data() + asked.size();
        const auto [end, error] = std::from_chars(asked.data(), last, index);
        if (error == std::errc() && end == last && index >= 1 && index <= names.size()) return index - 1;
        throw InputError(fmt::format("{}: has no column '{}'; {}", place(number_), asked, there));
    }

    void row(std::string_view text) {
        std::size_t count = 0;
        std::string_view field, mine, stamp;
        for (Fields fields(text, commas_); fields.next(field); ++count) {
            if (count == value_column_) mine = field;
            if (count == time_column_) stamp = field;
        }
        if (count != columns_) {
            throw InputError(fmt::format("{}: has {} {} where the first row has {}", place(number_), count,
                                         count == 1 ? "column" : "columns", columns_));
        }
        if (request_.time) time(stamp);
        value(mine);
    }

    void time(std::string_view field) {
        double time_s = 0.0;
        if (!parse_value(field, time_s)) {
            throw InputError(fmt::format("{}: column {}: '{}' is not a number; times must be numbers of seconds",
                                         place(number_), time_name_, shown(field)));
        }
        rows_.time(time_s, number_);
    }

    void value(std::string_view field) {
        std::errc whole = std::errc::invalid_argument;
        if (only_whole_) {
            std::int64_t count = 0;
            whole = parse_whole_number(field, count);
            if (whole == std::errc()) {
                rows_.count(count);
                return;
            }
        }
        double value = 0.0;
        if (!parse_value(field, value)) {
            throw InputError(
                fmt::format("{}: column {}: '{}' is not a number (a double, in plain notation); where a "
                            "value is missing, say nan",
                            place(number_), column_, shown(field)));
        }
        if (std::isnan(value)) {
            rows_.missing();
            return;
        }
        if (std::isinf(value)) {
            throw InputError(
                fmt::format("{}: column {}: is '{}'; every value must be finite; where it is not known, "
                            "say nan",
                            place(number_), column_, shown(field)));
        }
        if (whole == std::errc::result_out_of_range) {
            note_too_large(field);
        } else {
            only_whole_ = false;
        }
        rows_.value(value);
    }

    /// An error only where the column turns out to hold nothing but counts.
    void note_too_large(std::string_view field) {
        if (!too_large_.empty()) return;
        too_large_ = fmt::format(
            "{}: column {}: {} is beyond 64 bits; in a column of whole numbers, which are kept to "
            "the last digit, allowed are {} to {}. Subtract a constant, or write numbers with a "
            "decimal point, which are rounded to doubles",
            place(number_), column_, shown(field), std::numeric_limits<std::int64_t>::min(),
            std::numeric_limits<std::int64_t>::max());
    }

    static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

    std::string file_;
    const SeriesRequest& request_;
    SeriesRows rows_;
    std::string column_;
    std::string time_name_;
    std::optional<double> rate_hz_;
    std::size_t number_ = 0;
    std::size_t columns_ = 0;
    std::size_t value_column_ = none;
    std::size_t time_column_ = none;
    bool commas_ = false;
    bool only_whole_ = true;  ///< no value so far that was no whole number, be it too large
    std::string too_large_;   ///< what to say of the first that is
};

}  // namespace

SeriesInfo stream_text_series(const SeriesRequest& request, const TakePiece& take) {
    TextReader reader(request, take);
    for_each_line(request.path, [&](std::string_view line) { reader.line(line); });
    return reader.finish();
}

}  // namespace ringlock::record
