#include <fmt/format.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string_view>

#include "analysis/record/readers.hpp"
#include "engine/core/error.hpp"

namespace ringlock::record {
namespace {

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

std::string_view trimmed(std::string_view s) {
    while (!s.empty() && is_space(s.front())) s.remove_prefix(1);
    while (!s.empty() && is_space(s.back())) s.remove_suffix(1);
    return s;
}

/// The fields of one row, one after the other. White space around fields never counts; an empty field between commas
/// does.
class Fields {
   public:
    Fields(std::string_view row, bool commas) : rest_(row), commas_(commas) {}

    bool next(std::string_view& field) {
        if (done_) return false;
        if (commas_) {
            const std::size_t comma = rest_.find(',');
            field = trimmed(rest_.substr(0, comma));
            done_ = comma == std::string_view::npos;
            if (!done_) rest_.remove_prefix(comma + 1);
            return true;
        }
        while (!rest_.empty() && is_space(rest_.front())) rest_.remove_prefix(1);
        if (rest_.empty()) return false;
        std::size_t end = 0;
        while (end < rest_.size() && !is_space(rest_[end])) ++end;
        field = rest_.substr(0, end);
        rest_.remove_prefix(end);
        return true;
    }

   private:
    std::string_view rest_;
    bool commas_;
    bool done_ = false;
};

bool parse(std::string_view field, double& value) {
    if (field.size() > 1 && field.front() == '+' && field[1] != '-') field.remove_prefix(1);
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    return error == std::errc() && end == field.data() + field.size();
}

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
        if (!parse(value, rate) || !(rate > 0.0) || !std::isfinite(rate)) {
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
            numbers = numbers && (field.empty() || parse(field, value));
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
        if (!parse(mine, value)) {
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
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
    if (!file) throw InputError(fmt::format("{}: cannot be opened: {}", path, std::strerror(errno)));
    TextReader reader(path, column);
    constexpr std::size_t longest_line = std::size_t{1} << 22;
    std::vector<char> buffer(std::size_t{1} << 18);
    std::size_t filled = 0;
    for (;;) {
        const std::size_t got = std::fread(buffer.data() + filled, 1, buffer.size() - filled, file.get());
        if (got == 0) {
            if (std::ferror(file.get())) {
                throw InputError(fmt::format("{}: cannot be read: {}", path, std::strerror(errno)));
            }
            if (filled > 0) reader.line({buffer.data(), filled});
            break;
        }
        filled += got;
        std::size_t begin = 0;
        while (const void* found = std::memchr(buffer.data() + begin, '\n', filled - begin)) {
            const auto end = static_cast<std::size_t>(static_cast<const char*>(found) - buffer.data());
            reader.line({buffer.data() + begin, end - begin});
            begin = end + 1;
        }
        std::memmove(buffer.data(), buffer.data() + begin, filled - begin);
        filled -= begin;
        if (filled == buffer.size()) {
            if (buffer.size() >= longest_line) {
                throw InputError(
                    fmt::format("{}: a line is longer than {} bytes; is this a text file?", path, longest_line));
            }
            buffer.resize(2 * buffer.size());
        }
    }
    return reader.finish();
}

}  // namespace ringlock::record
