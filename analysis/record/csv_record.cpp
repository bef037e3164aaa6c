#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "analysis/record/readers.hpp"
#include "analysis/record/series/text_times.hpp"
#include "analysis/text/numbers.hpp"
#include "analysis/text/stamps.hpp"
#include "analysis/text/table.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {
namespace {

bool is_identifier(std::string_view key) {
    return !key.empty() && std::all_of(key.begin(), key.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
    });
}

/// Names of columns that hold the times of the rows, the likeliest first.
constexpr std::array time_names = {"time_s", "time", "t", "timestamp"};

/// Whether a column has that name; where `with_unit`, with a unit behind it as in time_ms. A name of one
/// letter must be plain: T_s may be the temperature of a surface, and t_min the lowest one.
bool has_time_name(const std::string& column, std::string_view name, bool with_unit) {
    std::string_view stem = column;
    if (with_unit) {
        const auto unit = text::declared_time_unit(column, "");
        if (!unit || (name.size() == 1 && unit->seconds > 1.0)) return false;
        stem = stem.substr(0, stem.find_last_of('_'));
    }
    return stem == name || (name.size() > 1 && text::lowered(stem) == name);
}

text::Wanted names_of_records() {
    text::Wanted wanted;
    wanted.header_needed = true;
    for (const SampleKind kind : sample_kinds) wanted.names.emplace_back(name_of(kind));
    wanted.names.insert(wanted.names.end(), witness_names.begin(), witness_names.end());
    return wanted;
}

class CsvReader {
   public:
    explicit CsvReader(const std::string& path)
        : path_(path), table_(path, {}, names_of_records(), [this](std::size_t line, std::string_view comment) {
              number_ = line;
              attribute(comment);
          }) {}

    Record read() {
        bool more = table_.next();
        number_ = table_.layout().line();
        if (!table_.layout().columns.empty()) header(more);
        for (; more; more = table_.next()) row();
        return finish();
    }

   private:
    enum class Target { none, value, count, witness };
    struct Column {
        std::string name;
        Target target = Target::none;
        std::vector<double>* into = nullptr;
    };

    Record finish() {
        if (columns_.empty()) {
            throw InputError(fmt::format(
                "{}: holds no header row (lines read: {}); a record is lines \"# key = value\", a row with the names "
                "of the columns and rows of numbers",
                printable(path_), table_.lines()));
        }
        if (samples_.size() == 0) {
            throw InputError(fmt::format("{}: has a header and no rows of numbers below it", printable(path_)));
        }
        if (!rate_given_) {
            throw InputError(
                fmt::format("{}: declares no rate; add a line \"# rate_hz = NUMBER\", samples a second, at the top",
                            printable(path_)));
        }
        if (times_) place_rows();
        record_.samples = std::move(samples_);
        return std::move(record_);
    }

    [[noreturn]] void fail(const std::string& what) const {
        throw InputError(fmt::format("{}:{}: {}", printable(path_), number_, what));
    }

    void attribute(std::string_view text) {
        const std::size_t equals = text.find('=');
        if (equals == std::string_view::npos) return;
        const std::string key(text::trimmed(text.substr(0, equals)));
        const std::string value(text::trimmed(text.substr(equals + 1)));
        if (!is_identifier(key)) return;  // a sentence
        if (!keys_.insert(key).second)
            fail(fmt::format("{} is given twice; leave one of the lines out", text::shown(key)));
        if (key == "format") {
            if (value != format_name) fail(fmt::format("format = '{}': must be {}", text::shown(value), format_name));
        } else if (key == "format_version") {
            if (number(key, value) != static_cast<double>(format_version)) {
                fail(fmt::format("format_version = {}: this program reads version {}", text::shown(value),
                                 format_version));
            }
        } else if (key == "rate_hz") {
            samples_.rate_hz = number(key, value);
            if (!(samples_.rate_hz > 0.0)) {
                fail(fmt::format("rate_hz = {}: must be a positive number of samples a second", text::shown(value)));
            }
            rate_given_ = true;
        } else if (key == "t0_s") {
            samples_.t0_s = number(key, value);
            t0_given_ = true;
        } else {
            for (const TextName& text_name : text_names) {
                if (key != text_name.name) continue;
                record_.*text_name.field = value;
                return;
            }
            for (const DeclaredName& declared : declared_names) {
                if (key != std::string("declared.") + declared.name) continue;
                record_.declared.*declared.field = number(key, value);
                return;
            }
            if (key.starts_with("reader.") && reader_attribute(key, value)) return;
            record_.ignored.push_back(fmt::format("line {}: {}", number_, text::shown(key)));
        }
    }

    bool reader_attribute(const std::string& key, const std::string& value) {
        const std::string name = key.substr(std::string_view("reader.").size());
        DeclaredReader reader = record_.reader.value_or(DeclaredReader{});
        std::string wrong;
        const bool word =
            std::any_of(reader_words.begin(), reader_words.end(), [&](const char* known) { return name == known; });
        const bool known = word ? set_reader_word(reader, name, value, wrong)
                                : set_reader_number(reader, name, number(key, value), wrong);
        if (!wrong.empty()) fail(fmt::format("{} {}", text::shown(key), wrong));
        if (known) record_.reader = reader;
        return known;
    }

    double number(std::string_view key, std::string_view text) const {
        double value = 0.0;
        if (!text::parse_number(text, value) || !std::isfinite(value)) {
            fail(fmt::format("{} = '{}': must be a finite number", text::shown(key), text::shown(text)));
        }
        return value;
    }

    void header(bool has_row) {
        if (!table_.layout().has_header) {
            fail(
                fmt::format("has numbers where the names of the columns must stand; "
                            "put a row such as \"{}\" above them",
                            name_of(SampleKind::angle_increment_arcsec)));
        }
        for (const text::Column& column : table_.layout().columns) columns_.push_back({column.name});
        find_times(has_row);
        std::set<std::string> seen;
        std::vector<std::string> kinds;
        for (std::size_t k = 0; k < columns_.size(); ++k) {
            Column& column = columns_[k];
            const bool first = seen.insert(column.name).second;
            for (const SampleKind kind : sample_kinds) {
                if (column.name != name_of(kind)) continue;
                kinds.push_back(column.name);
                samples_.kind = kind;
                column.target = kind == SampleKind::quarter_count ? Target::count : Target::value;
                column.into = &samples_.values;
            }
            for (const char* witness : witness_names) {
                if (column.name != witness) continue;
                column.target = Target::witness;
                column.into = &samples_.witnesses[witness];
            }
            if (column.target != Target::none && !first) {
                fail(fmt::format("column {} is there twice; rename or remove one", text::shown(column.name)));
            }
            check_unit(column, table_.layout().columns[k].unit);
            if (column.target == Target::none && !(times_ && times_->has(k))) {
                record_.ignored.push_back(fmt::format("line {}: column {}", number_, text::shown(column.name)));
            }
        }
        const bool turns = seen.contains("direction") || seen.contains("sin") || seen.contains("cos");
        if (kinds.size() == 1 && !turns) return;
        if (kinds.size() > 1) {
            fail(fmt::format("has the columns {}; a record has one of them", listed(kinds)));
        }
        std::vector<std::string> names;
        for (const Column& column : columns_) names.push_back(text::shown(column.name));
        if (turns) {
            fail(
                fmt::format("has columns of turns: {}; only samples have a text form, "
                            "turns must be written as HDF5 (docs/record.md)",
                            listed(names)));
        }
        fail(
            fmt::format("has no column of samples; columns are {}; one of angle_increment_arcsec, "
                        "angle_arcsec and quarter_count is needed",
                        listed(names)));
    }

    void check_unit(const Column& column, const std::string& unit) const {
        const bool angle = column.target == Target::value;
        if (!angle || unit.empty() || unit == "arcsec" || unit == "as") return;
        fail(
            fmt::format("column {} is declared to be in {}; a record has its angles in arcsec. "
                        "Read it with `ringlock import --column {}=QUANTITY --unit`",
                        column.name, text::shown(unit), column.name));
    }

    void find_times(bool has_row) {
        for (const bool with_unit : {false, true}) {
            for (const char* name : time_names) {
                for (const Column& column : columns_) {
                    if (times_ || !has_time_name(column.name, name, with_unit)) continue;
                    SeriesRequest request;
                    request.time = column.name;
                    const std::vector<std::string_view> none;
                    times_.emplace(table_.layout(), has_row ? table_.fields() : none, request, path_);
                }
            }
        }
    }

    void row() {
        number_ = table_.line();
        if (times_) stamps_.push_back({times_->of(table_), number_});
        for (std::size_t k = 0; k < columns_.size(); ++k) take(columns_[k], table_.fields()[k]);
    }

    /// Puts every row at the position of its time, and NaN at positions without a row.
    void place_rows() {
        const auto place = [this](std::size_t line) {
            return fmt::format("{}:{}: column {}", printable(path_), line, printable(times_->name()));
        };
        TimeGrid grid(samples_.rate_hz, place, times_->unit(), TimeGrid::UnitBy::header);
        grid.begin(std::span(stamps_).first(std::min(stamps_.size(), TimeGrid::first_rows)));
        std::vector<std::size_t> steps;
        steps.reserve(stamps_.size());
        std::size_t at = 0;
        for (std::size_t i = 0; i < stamps_.size(); ++i) {
            steps.push_back(grid.steps_to(stamps_[i].stamp, stamps_[i].row));
            at += steps[i];
            if (steps[i] > 1) {
                record_.gaps.push_back({stamps_[i].row, at - steps[i], steps[i] - 1,
                                        text::text_of(stamps_[i - 1].stamp, times_->unit()),
                                        text::text_of(stamps_[i].stamp, times_->unit())});
            }
        }
        grid.check_rate();
        if (!t0_given_) samples_.t0_s = stamps_.front().stamp.value() * times_->unit().seconds;
        if (record_.gaps.empty()) return;
        if (samples_.kind == SampleKind::quarter_count) refuse_gap_of_counts(record_.gaps.front());
        spread(samples_.values, steps);
        for (auto& witness : samples_.witnesses) spread(witness.second, steps);
    }

    [[noreturn]] void refuse_gap_of_counts(const Gap& gap) const {
        throw InputError(
            fmt::format("{}:{}: column {}: {} samples are missing between {} and {}; counts are whole numbers, "
                        "which cannot mark a missing sample. Cut the record there, or write the angle as angle_arcsec",
                        printable(path_), gap.line, name_of(samples_.kind), gap.samples, gap.from, gap.to));
    }

    static void spread(std::vector<double>& values, const std::vector<std::size_t>& steps) {
        std::vector<double> placed;
        for (std::size_t i = 0; i < values.size(); ++i) {
            placed.insert(placed.end(), steps[i] - 1, std::numeric_limits<double>::quiet_NaN());
            placed.push_back(values[i]);
        }
        values = std::move(placed);
    }

    void take(const Column& column, std::string_view field) {
        if (column.target == Target::none) return;
        if (column.target == Target::count) return take_count(column, field);
        double value = 0.0;
        if (!text::parse_value(field, value, table_.layout().dialect.decimal_comma) || std::isinf(value)) {
            fail(fmt::format("column {}: is '{}'; every value must be a finite number; where it is missing, say nan",
                             column.name, text::shown(field)));
        }
        column.into->push_back(value);
    }

    void take_count(const Column& column, std::string_view field) {
        std::int64_t whole = 0;
        if (text::parse_whole_number(field, whole) == std::errc()) {
            samples_.counts.push_back(whole);
            return;
        }
        double value = 0.0;
        constexpr double largest = 9007199254740992.0;  // 2^53: whole numbers of a double
        if (!text::parse_number(field, value, table_.layout().dialect.decimal_comma) ||
            value != std::nearbyint(value) || !(std::abs(value) <= largest)) {
            fail(
                fmt::format("column {}: {}; a count must be a whole number and cannot be missing. "
                            "Cut the record there; leaving the row out would shift all later times",
                            column.name, field.empty() ? "is empty" : fmt::format("is '{}'", text::shown(field))));
        }
        samples_.counts.push_back(static_cast<std::int64_t>(value));
    }

    const std::string& path_;
    text::Table table_;
    Record record_;
    Samples samples_;
    bool rate_given_ = false;
    bool t0_given_ = false;
    std::set<std::string> keys_;
    std::vector<Column> columns_;
    std::optional<TextTimes> times_;
    std::vector<StampedRow> stamps_;
    std::size_t number_ = 0;
};

}  // namespace

Record read_csv_record(const std::string& path) { return CsvReader(path).read(); }

}  // namespace ringlock::record
