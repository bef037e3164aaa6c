#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "analysis/record/readers.hpp"
#include "analysis/record/text_lines.hpp"
#include "engine/core/error.hpp"

namespace ringlock::record {
namespace {

bool is_identifier(std::string_view key) {
    return !key.empty() && std::all_of(key.begin(), key.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
    });
}

class CsvReader {
   public:
    explicit CsvReader(const std::string& path) : path_(path) {}

    void line(std::string_view text) {
        ++number_;
        if (number_ == 1 && text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
        if (text.find('\0') != std::string_view::npos) fail("holds a zero byte; a record is HDF5 or text");
        if (const std::size_t hash = text.find('#'); hash != std::string_view::npos) {
            if (trimmed(text.substr(0, hash)).empty()) attribute(trimmed(text.substr(hash + 1)));
            text = text.substr(0, hash);
        }
        text = trimmed(text);
        if (text.empty()) return;
        if (columns_.empty()) {
            header(text);
        } else {
            row(text);
        }
    }

    Record finish() {
        if (columns_.empty()) {
            throw InputError(fmt::format(
                "{}: holds no header row (lines read: {}); a record is lines \"# key = value\", a row with the names "
                "of the columns and rows of numbers",
                path_, number_));
        }
        if (samples_.size() == 0) {
            throw InputError(fmt::format("{}: has a header and no rows of numbers below it", path_));
        }
        if (!rate_given_) {
            throw InputError(
                fmt::format("{}: says no rate; add a line \"# rate_hz = NUMBER\", samples a second, at the "
                            "top",
                            path_));
        }
        record_.samples = std::move(samples_);
        return std::move(record_);
    }

   private:
    enum class Target { none, value, count, witness };
    struct Column {
        std::string name;
        Target target = Target::none;
        std::vector<double>* into = nullptr;
    };

    [[noreturn]] void fail(const std::string& what) const {
        throw InputError(fmt::format("{}:{}: {}", path_, number_, what));
    }

    void attribute(std::string_view text) {
        const std::size_t equals = text.find('=');
        if (equals == std::string_view::npos) return;
        const std::string key(trimmed(text.substr(0, equals)));
        const std::string value(trimmed(text.substr(equals + 1)));
        if (!is_identifier(key)) return;  // a sentence
        if (!keys_.insert(key).second) fail(fmt::format("{} stands twice; leave one of the lines out", shown(key)));
        if (key == "format") {
            if (value != format_name) fail(fmt::format("format = '{}': must be {}", shown(value), format_name));
        } else if (key == "format_version") {
            if (number(key, value) != static_cast<double>(format_version)) {
                fail(fmt::format("format_version = {}: this program reads version {}", shown(value), format_version));
            }
        } else if (key == "rate_hz") {
            samples_.rate_hz = number(key, value);
            if (!(samples_.rate_hz > 0.0)) {
                fail(fmt::format("rate_hz = {}: must be a positive number of samples a second", shown(value)));
            }
            rate_given_ = true;
        } else if (key == "t0_s") {
            samples_.t0_s = number(key, value);
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
            record_.ignored.push_back(fmt::format("line {}: {}", number_, shown(key)));
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
        if (!wrong.empty()) fail(fmt::format("{} {}", shown(key), wrong));
        if (known) record_.reader = reader;
        return known;
    }

    double number(std::string_view key, std::string_view text) const {
        double value = 0.0;
        if (!parse_number(text, value) || !std::isfinite(value)) {
            fail(fmt::format("{} = '{}': must be a finite number", shown(key), shown(text)));
        }
        return value;
    }

    void header(std::string_view text) {
        commas_ = text.find(',') != std::string_view::npos;
        bool numbers = true;
        std::string_view field;
        double value = 0.0;
        for (Fields fields(text, commas_); fields.next(field);) {
            numbers = numbers && parse_number(field, value);
            columns_.push_back({std::string(field)});
        }
        if (numbers) {
            fail(
                fmt::format("has numbers where the names of the columns must stand; put a row such as \"{}\" above "
                            "them",
                            name_of(SampleKind::angle_increment_arcsec)));
        }
        std::set<std::string> seen;
        std::vector<std::string> kinds;
        for (Column& column : columns_) {
            if (column.name.empty()) fail("a column has no name");
            if (!seen.insert(column.name).second) {
                fail(fmt::format("column {} stands twice; rename or remove one", shown(column.name)));
            }
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
            if (column.target == Target::none) {
                record_.ignored.push_back(fmt::format("line {}: column {}", number_, shown(column.name)));
            }
        }
        const bool turns = seen.contains("direction") || seen.contains("sin") || seen.contains("cos");
        if (kinds.size() == 1 && !turns) return;
        if (kinds.size() > 1) {
            fail(fmt::format("has the columns {}; a record has one of them", listed(kinds)));
        }
        std::vector<std::string> names;
        for (const Column& column : columns_) names.push_back(shown(column.name));
        if (turns) {
            fail(
                fmt::format("has columns of turns: {}; only samples have a text form, turns must be written as HDF5 "
                            "(docs/record.md)",
                            listed(names)));
        }
        fail(
            fmt::format("has no column of samples; columns are {}; one of angle_increment_arcsec, angle_arcsec and "
                        "quarter_count is needed",
                        listed(names)));
    }

    void row(std::string_view text) {
        std::size_t count = 0;
        std::string_view field;
        for (Fields fields(text, commas_); fields.next(field); ++count) {
            if (count < columns_.size()) take(columns_[count], field);
        }
        if (count != columns_.size()) {
            fail(fmt::format("has {} {} where the header has {}", count, count == 1 ? "column" : "columns",
                             columns_.size()));
        }
    }

    void take(const Column& column, std::string_view field) {
        if (column.target == Target::none) return;
        if (column.target == Target::count) {
            std::int64_t whole = 0;
            const std::string_view digits = field.starts_with("+") ? field.substr(1) : field;
            const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), whole);
            if (error == std::errc() && end == digits.data() + digits.size()) {
                samples_.counts.push_back(whole);
                return;
            }
        }
        double value = 0.0;
        if (!parse_number(field, value) || !std::isfinite(value)) {
            fail(
                fmt::format("column {}: {}; every value must be a finite number, for samples are without gaps. Cut the "
                            "record there, or fill the gap knowingly; leaving the row out would shift all later times",
                            column.name, field.empty() ? "is empty" : fmt::format("is '{}'", shown(field))));
        }
        if (column.target == Target::count) {
            constexpr double largest = 9007199254740992.0;  // 2^53: whole numbers of a double
            if (value != std::nearbyint(value) || std::abs(value) > largest) {
                fail(fmt::format("column {}: is '{}'; a count must be a whole number", column.name, shown(field)));
            }
            samples_.counts.push_back(static_cast<std::int64_t>(value));
        } else {
            column.into->push_back(value);
        }
    }

    const std::string& path_;
    Record record_;
    Samples samples_;
    bool rate_given_ = false;
    std::set<std::string> keys_;
    std::vector<Column> columns_;
    std::size_t number_ = 0;
    bool commas_ = false;
};

}  // namespace

Record read_csv_record(const std::string& path) {
    CsvReader reader(path);
    for_each_line(path, [&](std::string_view line) { reader.line(line); });
    return reader.finish();
}

}  // namespace ringlock::record
