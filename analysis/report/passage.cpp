#include "analysis/report/passage.hpp"

#include <algorithm>
#include <cstddef>

namespace ringlock::report {

std::string text_of(const Passage& passage) {
    std::string text;
    if (!passage.heading.empty()) text += passage.heading + "\n";
    text += passage.before;
    if (passage.table) text += passage.table->text();
    return text + passage.notes;
}

std::string text_of(std::span<const Passage> passages) {
    std::string text;
    for (const Passage& passage : passages) text += (text.empty() ? "" : "\n") + text_of(passage);
    return text;
}

std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        if (end > begin) lines.push_back(text.substr(begin, end - begin));
        begin = end + 1;
    }
    return lines;
}

}  // namespace ringlock::report
