#include "engine/scenario/text/text.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/core/printable.hpp"

namespace ringlock::scenario {
namespace {

/// Edits that turn one word into the other: insert, delete, replace, swap of neighbours.
std::size_t edit_distance(std::string_view a, std::string_view b) {
    const std::size_t width = b.size() + 1;
    std::vector<std::size_t> d((a.size() + 1) * width);
    for (std::size_t i = 0; i <= a.size(); ++i) {
        for (std::size_t j = 0; j <= b.size(); ++j) {
            std::size_t& here = d[i * width + j];
            if (i == 0 || j == 0) {
                here = i + j;
                continue;
            }
            here = std::min({d[(i - 1) * width + j] + 1, d[i * width + j - 1] + 1,
                             d[(i - 1) * width + j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
                here = std::min(here, d[(i - 2) * width + j - 2] + 1);
            }
        }
    }
    return d.back();
}

constexpr std::size_t longest_word = 80;

/// Distance in which a forgotten or wrong unit at the end is one mistake: "lockin_threshold" is near
/// "lockin_threshold_deg_h".
std::size_t distance(std::string_view word, std::string_view candidate) {
    const bool unit_forgotten = word.size() >= 4 && candidate.starts_with(word);
    return unit_forgotten ? 1 : edit_distance(word, candidate);
}

}  // namespace

std::string format_real(double value) {
    std::string text = fmt::format("{}", value);
    if (text.find_first_of(".en") == std::string::npos) text += ".0";
    return text;
}

std::string in_quotes(std::string_view text) {
    constexpr std::size_t longest = 60;
    std::size_t end = std::min(longest, text.size());
    while (end < text.size() && end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0U) == 0x80) --end;
    std::string out = "\"";
    for (const char c : text.substr(0, end)) {
        if (c == '"' || c == '\\') out += '\\';
        out += c;
    }
    return printable(out) + (text.size() > longest ? "...\"" : "\"");
}

std::string did_you_mean(std::string_view word, const std::vector<std::string>& candidates) {
    if (word.size() > longest_word) return "";
    std::size_t best = std::max<std::size_t>(2, word.size() / 3) + 1;
    const std::string* closest = nullptr;
    for (const std::string& candidate : candidates) {
        const std::size_t d = distance(word, candidate);
        if (d < best) {
            best = d;
            closest = &candidate;
        }
    }
    return closest == nullptr ? "" : fmt::format(" (did you mean \"{}\"?)", *closest);
}

}  // namespace ringlock::scenario
