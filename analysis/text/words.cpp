#include "analysis/text/words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "engine/core/printable.hpp"

namespace ringlock::text {

std::string_view trimmed(std::string_view s) {
    while (!s.empty() && is_space(s.front())) s.remove_prefix(1);
    while (!s.empty() && is_space(s.back())) s.remove_suffix(1);
    return s;
}

std::string lowered(std::string_view s) {
    std::string out(s);
    for (char& c : out) {
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    }
    return out;
}

std::string shown(std::string_view text) {
    constexpr std::size_t longest = 60;
    std::size_t end = std::min(longest, text.size());
    // Not within a character of UTF-8.
    while (end < text.size() && end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0U) == 0x80) --end;
    return printable(text.substr(0, end)) + (text.size() > longest ? "..." : "");
}

bool parse_index(std::string_view text, std::size_t& index) {
    const char* last = text.data() + text.size();
    const auto [end, error] = std::from_chars(text.data(), last, index);
    return error == std::errc() && end == last;
}

std::string name_of_file(const std::string& path) {
    return path == standard_input ? "standard input" : printable(path);
}

std::string listed(const std::vector<std::string>& names) {
    constexpr std::size_t most = 20;
    std::string out;
    for (std::size_t i = 0; i < names.size() && i < most; ++i) out += fmt::format("{}{}", i > 0 ? ", " : "", names[i]);
    if (names.size() > most) out += fmt::format(", ... ({} in all)", names.size());
    return out;
}

namespace {

/// Letters to insert, remove or replace (Levenshtein), of words of moderate length.
std::size_t letters_apart(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t above = row[j];
            row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
            diagonal = above;
        }
    }
    return row[b.size()];
}

}  // namespace

std::string nearest(const std::string& asked, const std::vector<std::string>& names) {
    constexpr std::size_t longest = 100;
    if (asked.size() > longest) return "";
    const std::string wanted = lowered(asked);
    std::size_t best = std::max<std::size_t>(1, wanted.size() / 3) + 1;
    std::string found;
    for (const std::string& name : names) {
        if (name.size() > longest) continue;
        const std::size_t apart = letters_apart(wanted, lowered(name));
        if (apart >= best || apart >= name.size()) continue;
        best = apart;
        found = name;
    }
    return found;
}

}  // namespace ringlock::text
