#include "analysis/text/fields.hpp"

#include <fmt/format.h>

#include "analysis/text/words.hpp"

namespace ringlock::text {
namespace {

enum : unsigned char { ordinary = 0, parts = 1, special = 2 };

unsigned char as_byte(char c) { return static_cast<unsigned char>(c); }

}  // namespace

std::string name_of(const Dialect& dialect) {
    switch (dialect.delimiter) {
        case ',':
            return "commas";
        case ';':
            return "semicolons";
        case '\t':
            return "tabs";
        case ' ':
            return "white space";
        default:
            return fmt::format("'{}'", dialect.delimiter);
    }
}

bool is_comment(std::string_view line, const Dialect& dialect) {
    std::size_t at = 0;
    while (at < line.size() && is_space(line[at]) && line[at] != dialect.delimiter) ++at;
    if (dialect.by_space()) {
        while (at < line.size() && is_space(line[at])) ++at;
    }
    if (at == line.size()) return false;
    const char c = line[at];
    if (c == dialect.delimiter) return false;
    return c == '#' || c == '%' || c == ';' || (c == '/' && at + 1 < line.size() && line[at + 1] == '/');
}

std::string_view without_mark(std::string_view line) {
    line = trimmed(line);
    const char mark = line.empty() ? '\0' : line.front();
    while (!line.empty() && line.front() == mark) line.remove_prefix(1);
    return trimmed(line);
}

Fields::Fields(Dialect dialect) : dialect_(dialect), kinds_(256, ordinary) {
    kinds_[as_byte('"')] = kinds_[as_byte('#')] = special;
    kinds_[as_byte(dialect_.delimiter)] = parts;
    if (!dialect_.by_space()) return;
    for (const char c : {' ', '\t', '\r', '\v', '\f'}) kinds_[as_byte(c)] = parts;
}

const std::vector<std::string_view>& Fields::divide(std::string_view row, bool whole) {
    fields_.clear();
    broken_ = 0;
    if (!divide_plain(row)) {
        fields_.clear();
        unquoted_.clear();
        divide_quoted(row, whole);
    }
    return fields_;
}

/// False where the row needs the slow method: quotes, a comment.
bool Fields::divide_plain(std::string_view row) {
    const char* begin = row.data();
    const char* const end = begin + row.size();
    const unsigned char* const kinds = kinds_.data();
    if (dialect_.by_space()) {
        for (;;) {
            while (begin != end && kinds[as_byte(*begin)] == parts) ++begin;
            if (begin == end) return true;
            const char* at = begin;
            while (at != end && kinds[as_byte(*at)] == ordinary) ++at;
            if (at != end && kinds[as_byte(*at)] == special) return false;
            fields_.emplace_back(begin, static_cast<std::size_t>(at - begin));
            begin = at;
        }
    }
    for (;;) {
        const char* at = begin;
        while (at != end && kinds[as_byte(*at)] == ordinary) ++at;
        if (at != end && kinds[as_byte(*at)] == special) return false;
        const char* last = at;
        while (begin != last && is_space(*begin)) ++begin;
        while (begin != last && is_space(last[-1])) --last;
        fields_.emplace_back(begin, static_cast<std::size_t>(last - begin));
        if (at == end) return true;
        begin = at + 1;
    }
}

/// Between delimiters `#` may belong to a word, as in "sensor #2": a comment there has white space behind its mark as
/// well, or no delimiter behind it.
bool Fields::begins_comment(std::string_view row, std::size_t at) const {
    if (at >= row.size() || row[at] != '#' || (at > 0 && !is_space(row[at - 1]))) return false;
    if (dialect_.by_space() || at == 0 || at + 1 == row.size() || is_space(row[at + 1])) return true;
    return row.find(dialect_.delimiter, at) == std::string_view::npos;
}

void Fields::divide_quoted(std::string_view row, bool whole) {
    std::size_t at = 0;
    for (;;) {
        while (at < row.size() && is_space(row[at]) && row[at] != dialect_.delimiter) ++at;
        if (dialect_.by_space()) {
            while (at < row.size() && is_space(row[at])) ++at;
            if (at == row.size()) return;
        }
        const bool comment = !whole && begins_comment(row, at);
        if (comment && dialect_.by_space()) return;
        if (comment) {
            // Behind the last delimiter stands an empty field and the comment.
            fields_.emplace_back();
            return;
        }
        const bool quoted = at < row.size() && row[at] == '"';
        at = quoted ? take_quoted(row, at) : take_plain(row, at, whole);
        if (at >= row.size()) return;
        ++at;  // the delimiter
        if (at == row.size() && dialect_.by_space()) return;
    }
}

/// From the quote at `at`; returns where the delimiter behind the field stands, or the end.
std::size_t Fields::take_quoted(std::string_view row, std::size_t at) {
    std::string& field = unquoted_.emplace_back();
    bool closed = false;
    for (++at; at < row.size(); ++at) {
        if (row[at] != '"') {
            field += row[at];
        } else if (at + 1 < row.size() && row[at + 1] == '"') {
            field += row[at++];
        } else {
            closed = true;
            ++at;
            break;
        }
    }
    const std::string_view trim = trimmed(field);
    fields_.push_back(trim);
    if (!closed && broken_ == 0) broken_ = fields_.size();
    const std::size_t behind = at;
    while (at < row.size() && kinds_[as_byte(row[at])] != parts) {
        if (at > behind && begins_comment(row, at)) return row.size();
        if (!is_space(row[at]) && broken_ == 0) broken_ = fields_.size();
        ++at;
    }
    return at;
}

std::size_t Fields::take_plain(std::string_view row, std::size_t at, bool whole) {
    const std::size_t begin = at;
    while (at < row.size() && kinds_[as_byte(row[at])] != parts) {
        if (!whole && at > 0 && begins_comment(row, at)) {
            fields_.push_back(trimmed(row.substr(begin, at - begin)));
            return row.size();
        }
        ++at;
    }
    fields_.push_back(trimmed(row.substr(begin, at - begin)));
    return at;
}

}  // namespace ringlock::text
