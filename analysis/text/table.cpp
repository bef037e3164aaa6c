#include "analysis/text/table.hpp"

#include <fmt/format.h>

#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/notice.hpp"

namespace ringlock::text {
namespace {

constexpr std::size_t sample_bytes = std::size_t{1} << 20;
constexpr std::size_t most_sample_bytes = std::size_t{1} << 24;  // comments included
constexpr std::size_t enough_rows = 1000;                        // that look like numbers, one after the other

/// Whether it may begin a row of numbers.
bool begins_number(char c) { return (c >= '0' && c <= '9') || c == '-' || c == '+' || c == '.' || c == '"'; }

/// Whether it may begin a comment in any dialect.
bool begins_comment(char c) { return c == '#' || c == '%' || c == '/' || c == ';'; }

}  // namespace

Table::Table(const std::string& path, const Options& options, const Wanted& wanted, OnComment on_comment)
    : Table(open_text(path), name_of_file(path), options, wanted, std::move(on_comment)) {}

Table::Table(std::unique_ptr<Source> from, const std::string& name, const Options& options, const Wanted& wanted,
             OnComment on_comment)
    : name_(name), on_comment_(std::move(on_comment)), lines_(std::move(from), name) {
    take_sample(options);
    layout_ = find_layout(sample_, options, wanted, name_);
    divider_ = Fields(layout_.dialect);
    if (options.quiet) return;
    for (const std::string& said : layout_.notes) notice("note: " + said);
}

void Table::take_sample(const Options& options) {
    std::size_t bytes = 0;
    std::size_t of_rows = 0;
    std::size_t rows = 0;
    std::string_view line;
    while (rows < enough_rows && of_rows < sample_bytes && bytes < most_sample_bytes && lines_.next(line)) {
        sample_.emplace_back(line);
        bytes += line.size() + 1;
        const std::string_view text = trimmed(line);
        const bool may_be_row = sample_.size() > options.skip && !text.empty() && !begins_comment(text.front());
        if (!may_be_row) continue;
        of_rows += line.size() + 1;
        rows = begins_number(text.front()) ? rows + 1 : 0;
    }
}

bool Table::next_line(std::string_view& text) {
    if (given_ < sample_.size()) {
        text = sample_[given_++];
        line_ = given_;
        return true;
    }
    if (!sample_.empty()) {
        std::vector<std::string>().swap(sample_);
        given_ = 0;
    }
    if (!lines_.next(text)) return false;
    line_ = lines_.number();
    return true;
}

void Table::fail(const std::string& what) const { throw InputError(fmt::format("{}:{}: {}", name_, line_, what)); }

void Table::refuse_width() const {
    const std::size_t found = fields_->size();
    fail(fmt::format("has {} {} where the {} has {}; columns are separated by {}", found,
                     found == 1 ? "column" : "columns", layout_.has_header ? "header" : "first row",
                     layout_.columns.size(), name_of(layout_.dialect)));
}

bool Table::next() {
    std::string_view text;
    while (next_line(text)) {
        std::size_t at = 0;
        while (at < text.size() && is_space(text[at])) ++at;
        if (at == text.size()) continue;
        if (begins_comment(text[at]) && is_comment(text, layout_.dialect)) {
            on_comment_(line_, without_mark(text));
            continue;
        }
        if (line_ < layout_.first_line || layout_.first_line == 0) continue;
        fields_ = &divider_.divide(text);
        if (divider_.broken() != 0) {
            fail(
                fmt::format("column {}: the quotes around it do not close, or text follows them; "
                            "a quote within quotes is written \"\"",
                            divider_.broken()));
        }
        if (fields_->size() != layout_.columns.size()) refuse_width();
        return true;
    }
    return false;
}

}  // namespace ringlock::text
