#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <string_view>

#include "analysis/record/readers.hpp"
#include "analysis/record/series/text_times.hpp"
#include "analysis/text/columns.hpp"
#include "analysis/text/numbers.hpp"
#include "analysis/text/table.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/notice.hpp"

namespace ringlock::record {
namespace {

text::Wanted wanted_by(const SeriesRequest& request) {
    text::Wanted wanted;
    if (request.column) wanted.names.push_back(*request.column);
    if (request.time) wanted.names.push_back(*request.time);
    return wanted;
}

class TextSeries {
   public:
    TextSeries(const SeriesRequest& request, const TakePiece& take)
        : file_(text::name_of_file(request.path)),
          request_(request),
          table_(request.path, request.text, wanted_by(request),
                 [this](std::size_t line, std::string_view comment) { attribute(line, comment); }),
          rows_(take) {}

    SeriesInfo read() {
        bool more = table_.next();
        if (!columns().empty()) choose(more);
        for (; more; more = table_.next()) {
            if (times_) rows_.time(times_->of(table_), table_.line());
            watch_first_column();
            rows_.line(table_.line());
            value(table_.fields()[value_column_]);
        }
        return finish();
    }

   private:
    std::string place(std::size_t line) const { return fmt::format("{}:{}", file_, line); }
    std::string place_of_value() const { return fmt::format("{}: column {}", place(table_.line()), column_); }
    const std::vector<text::Column>& columns() const { return table_.layout().columns; }

    void attribute(std::size_t line, std::string_view text) {
        const std::size_t equals = text.find('=');
        if (equals == std::string_view::npos || text::trimmed(text.substr(0, equals)) != "rate_hz") return;
        const std::string_view value = text::trimmed(text.substr(equals + 1));
        double rate = 0.0;
        if (!text::parse_number(value, rate) || !(rate > 0.0) || !std::isfinite(rate)) {
            throw InputError(
                fmt::format("{}: rate_hz = '{}': must be a positive number", place(line), text::shown(value)));
        }
        rate_hz_ = rate;
    }

    void choose(bool has_row) {
        const text::Layout& layout = table_.layout();
        if (request_.time) {
            const std::vector<std::string_view> none;
            times_.emplace(layout, has_row ? table_.fields() : none, request_, file_);
            rows_.set_grid(TimeGrid(
                request_.rate_hz,
                [this](std::size_t line) { return fmt::format("{}: column {}", place(line), times_->name()); },
                times_->unit()));
        }
        const std::size_t of_time = times_ ? times_->columns() : 0;
        if (request_.column) {
            value_column_ = text::find_column(layout, *request_.column, file_);
            note_name_of_number();
        } else if (columns().size() == of_time + 1) {
            while (times_ && times_->has(value_column_)) ++value_column_;
        } else {
            throw InputError(fmt::format("{}: has {} {}{}; choose one with --column ({})", place(layout.line()),
                                         columns().size(), columns().size() == 1 ? "column" : "columns",
                                         times_ ? fmt::format(", of which {} is the time", times_->name()) : "",
                                         text::columns_text(layout)));
        }
        column_ = text::shown(columns()[value_column_].heading);
    }

    /// Where names are numbers, the name of one column is the number of another.
    void note_name_of_number() const {
        std::size_t number = 0;
        if (request_.text.quiet || !text::parse_index(*request_.column, number)) return;
        if (number == value_column_ + 1 || number < 1 || number > columns().size()) return;
        notice(fmt::format("note: {}: {} is taken for the name of column {}, not for the number of column {}", file_,
                           *request_.column, value_column_ + 1, number));
    }

    /// A first column of numbers in which a word stands, as in "Mean,0.12" below a table.
    void watch_first_column() {
        if (first_is_watched_ && value_column_ > 0) watch(table_.fields().front());
    }
    void watch(std::string_view field) {
        constexpr std::size_t enough = 10;
        const std::size_t sign = field.starts_with('-') || field.starts_with('+') ? 1 : 0;
        const bool begins_number = field.size() > sign && field[sign] >= '0' && field[sign] <= '9';
        double number = 0.0;
        if (begins_number || text::parse_value(field, number, table_.layout().dialect.decimal_comma)) {
            ++first_numbers_;
            return;
        }
        first_is_watched_ = false;
        if (first_numbers_ < enough || request_.text.quiet || (times_ && times_->has(0))) return;
        notice(fmt::format(
            "warning: {}: column {} has '{}' where all rows above it have numbers; a summary or another table "
            "may begin there, and its values are used. Cut off what is no data",
            place(table_.line()), text::shown(columns().front().heading), text::shown(field)));
    }

    void value(std::string_view field) {
        std::errc whole = std::errc::invalid_argument;
        if (only_whole_) {
            std::int64_t count = 0;
            whole = text::parse_whole_number(field, count);
            if (whole == std::errc()) {
                rows_.count(count);
                return;
            }
        }
        double value = 0.0;
        if (!text::parse_value(field, value, table_.layout().dialect.decimal_comma)) {
            throw InputError(
                fmt::format("{}: '{}' is not a number (a double, in plain notation{}); "
                            "where a value is missing, say nan",
                            place_of_value(), text::shown(field),
                            table_.layout().dialect.decimal_comma ? " with a decimal comma" : ""));
        }
        if (std::isnan(value)) {
            rows_.missing();
            return;
        }
        if (std::isinf(value)) {
            throw InputError(
                fmt::format("{}: is '{}'; every value must be finite; where it is not known, "
                            "say nan",
                            place_of_value(), text::shown(field)));
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
            "{}: {} is beyond 64 bits; in a column of whole numbers, which are kept to the last digit, allowed "
            "are {} to {}. Subtract a constant, or write numbers with a decimal point, which are rounded to doubles",
            place_of_value(), text::shown(field), std::numeric_limits<std::int64_t>::min(),
            std::numeric_limits<std::int64_t>::max());
    }

    SeriesInfo finish() {
        if (only_whole_ && !too_large_.empty()) throw InputError(too_large_);
        SeriesInfo info = rows_.finish();
        if (info.n == 0) {
            throw InputError(
                fmt::format("{}: holds no data (lines read: {}); rows of numbers are needed", file_, table_.lines()));
        }
        info.column = column_;
        if (!columns()[value_column_].unit.empty()) info.unit = columns()[value_column_].unit;
        info.rate_hz = rate_hz_;
        return info;
    }

    std::string file_;
    const SeriesRequest& request_;
    text::Table table_;
    SeriesRows rows_;
    std::optional<TextTimes> times_;
    std::string column_;
    std::optional<double> rate_hz_;
    std::size_t value_column_ = 0;
    bool first_is_watched_ = true;
    std::size_t first_numbers_ = 0;  ///< rows whose first column has a number
    bool only_whole_ = true;         ///< no value so far that was no whole number, be it too large
    std::string too_large_;          ///< message about the first value that is too large
};

}  // namespace

SeriesInfo stream_text_series(const SeriesRequest& request, const TakePiece& take) {
    return TextSeries(request, take).read();
}

}  // namespace ringlock::record
