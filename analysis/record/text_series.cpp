#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string_view>

#include "analysis/record/readers.hpp"
#include "analysis/record/text_lines.hpp"
#include "engine/core/error.hpp"

namespace ringlock::record {
namespace {

class TextReader {
   public:
    TextReader(const std::string& path, const std::optional<std::string>& column) : path_(path), asked_(column) {}

    void line(std::string_view text) {
        ++number_;
        if (number_ == 1 && text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
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

    Series finish() {
        if (out_.values.empty()) {
            throw InputError(
                fmt::format("{}: holds no data (lines read: {}); rows of numbers are needed", path_, number_));
        }
        return std::move(out_);
    }

   private:
    void attribute(std::string_view text) {
        const std::size_t equals = text.find('=');
        if (equals == std::string_view::npos || trimmed(text.substr(0, equals)) != "rate_hz") return;
        const std::string_view value = trimmed(text.substr(equals + 1));
        double rate = 0.0;
        if (!parse_number(value, rate) || !(rate > 0.0) || !std::isfinite(rate)) {
            throw InputError(fmt::format("{}:{}: rate_hz = '{}': must be a positive number", path_, number_, value));
        }
        out_.rate_hz = rate;
    }

    /// Looks at the first row; true where it is a header.
    bool first_row(std::string_view text) {
        commas_ = text.find(',') != std::string_view::npos;
        std::vector<std::string> names;
        bool numbers = true;
        std::string_view field;
        double value = 0.0;
        for (Fields fields(text, commas_); fields.next(field);) {
            names.emplace_back(field);
            numbers = numbers && (field.empty() || parse_number(field, value));
        }
        columns_ = names.size();
        if (numbers) {
            for (std::size_t i = 0; i < names.size(); ++i) names[i] = std::to_string(i + 1);
        }
        choose(names, !numbers);
        return !numbers;
    }

    void choose(const std::vector<std::string>& names, bool header) {
        const std::string what = header ? fmt::format("columns are {}", listed(names))
                                        : fmt::format("columns have no names and are numbered 1 to {}", names.size());
        if (!asked_) {
            if (names.size() != 1) {
                throw InputError(fmt::format("{}:{}: has {} columns; say which with --column ({})", path_, number_,
                                             names.size(), what));
            }
            chosen_ = 0;
        } else {
            for (chosen_ = 0; chosen_ < names.size() && names[chosen_] != *asked_;) ++chosen_;
            std::size_t index = 0;
            const char* last = asked_->data() + asked_->size();
            const auto [end, error] = std::from_chars(asked_->data(), last, index);
            if (chosen_ == names.size() && error == std::errc() && end == last && index >= 1 && index <= names.size()) {
                chosen_ = index - 1;
            }
            if (chosen_ == names.size()) {
                throw InputError(fmt::format("{}:{}: has no column '{}'; {}", path_, number_, *asked_, what));
            }
        }
        out_.column = names[chosen_];
    }

    void row(std::string_view text) {
        std::size_t count = 0;
        std::string_view field;
        std::string_view mine;
        for (Fields fields(text, commas_); fields.next(field); ++count) {
            if (count == chosen_) mine = field;
        }
        if (count != columns_) {
            throw InputError(fmt::format("{}:{}: has {} {} where the first row has {}", path_, number_, count,
                                         count == 1 ? "column" : "columns", columns_));
        }
        double value = 0.0;
        if (!parse_number(mine, value)) {
            if (mine.empty()) missing("is empty");
            throw InputError(fmt::format("{}:{}: column {}: '{}' is not a number", path_, number_, out_.column, mine));
        }
        if (!std::isfinite(value)) missing(fmt::format("is '{}'", mine));
        out_.values.push_back(value);
    }

    [[noreturn]] void missing(const std::string& what) const {
        throw InputError(fmt::format(
            "{}:{}: column {}: {}; every value must be a finite number, for gaps are not handled yet. Cut the record "
            "there "
            "and analyse the pieces, or fill the gap knowingly; leaving the row out would shift all later times",
            path_, number_, out_.column, what));
    }

    const std::string& path_;
    const std::optional<std::string>& asked_;
    Series out_;
    std::size_t number_ = 0;
    std::size_t columns_ = 0;
    std::size_t chosen_ = 0;
    bool commas_ = false;
};

}  // namespace

Series read_text_series(const std::string& path, const std::optional<std::string>& column) {
    TextReader reader(path, column);
    for_each_line(path, [&](std::string_view line) { reader.line(line); });
    return reader.finish();
}

}  // namespace ringlock::record
