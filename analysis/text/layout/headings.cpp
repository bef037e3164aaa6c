#include "analysis/text/layout/headings.hpp"

#include <algorithm>

#include "analysis/text/layout/units.hpp"
#include "analysis/text/words.hpp"

namespace ringlock::text {
namespace {

std::vector<std::string> divided(std::string_view line, const Dialect& dialect, bool whole) {
    Fields divider(dialect);
    std::vector<std::string> out;
    for (const std::string_view field : divider.divide(line, whole)) out.emplace_back(field);
    return divider.broken() != 0 ? std::vector<std::string>{} : out;
}

/// At tabs and where two blanks or more stand: names may have single ones.
std::vector<std::string> divided_widely(std::string_view line) {
    std::vector<std::string> out;
    line = trimmed(line);
    std::size_t begin = 0;
    for (std::size_t at = 0; at <= line.size(); ++at) {
        const bool parts = at == line.size() || line[at] == '\t' || line.substr(at).starts_with("  ");
        if (!parts) continue;
        if (const std::string_view name = trimmed(line.substr(begin, at - begin)); !name.empty())
            out.emplace_back(name);
        while (at < line.size() && is_space(line[at])) ++at;
        begin = at;
    }
    return out;
}

/// "time", "[s]", "w_x", "[rad", "s^-1]": brackets belong to the name before them.
std::vector<std::string> with_brackets_joined(const std::vector<std::string>& words) {
    std::vector<std::string> out;
    char close = '\0';
    for (const std::string& word : words) {
        const bool opens = word.front() == '[' || word.front() == '(';
        if (close != '\0' || (opens && !out.empty())) {
            if (out.empty()) return {};
            if (close == '\0') close = word.front() == '[' ? ']' : ')';
            out.back() += " " + word;
            if (word.back() == close) close = '\0';
        } else {
            out.push_back(word);
        }
    }
    return out;
}

}  // namespace

std::vector<std::string> headings(std::string_view line, const Dialect& dialect, std::size_t columns, bool last_empty) {
    if (columns == 0) return {};
    std::vector<std::vector<std::string>> ways;
    for (const bool whole : {true, false}) ways.push_back(divided(line, dialect, whole));
    const std::vector<std::string> plain = ways[1];
    ways.push_back(divided_widely(line));
    ways.push_back(with_brackets_joined(divided(line, Dialect{}, true)));
    if (columns > 1) {
        for (const char other : {',', ';', '\t', ' '}) ways.push_back(divided(line, Dialect{other, false}, true));
    }
    for (const auto& way : ways) {
        const bool any = std::any_of(way.begin(), way.end(), [](const std::string& name) { return !name.empty(); });
        if (way.size() == columns && any) return way;
    }
    if (plain.size() + 1 != columns || plain.size() < 1 || columns < 2) return {};
    if (!dialect.by_space() && !last_empty) return {};
    std::vector<std::string> one_short = plain;
    one_short.insert(dialect.by_space() ? one_short.begin() : one_short.end(), "");
    return one_short;
}

}  // namespace ringlock::text
