#include "analysis/text/columns.hpp"

#include <fmt/format.h>

#include <string_view>
#include <vector>

#include "analysis/text/fields.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"

namespace ringlock::text {

std::string columns_text(const Layout& layout) {
    if (!layout.has_header) {
        return fmt::format("columns have no names and are numbered 1 to {}", layout.columns.size());
    }
    std::vector<std::string> names;
    for (const Column& column : layout.columns) names.push_back(shown(column.heading));
    return fmt::format("columns are {}", listed(names));
}

std::size_t find_column(const Layout& layout, const std::string& asked, const std::string& file) {
    std::string_view unquoted = asked;
    if (unquoted.size() > 2 && unquoted.front() == '"' && unquoted.back() == '"') {
        unquoted = unquoted.substr(1, unquoted.size() - 2);
    }
    std::vector<std::size_t> found;
    // The first name of a header that is a comment may be requested with the mark of comments, as "%time".
    if (layout.has_header && unquoted.size() > 1 &&
        std::string_view("#%").find(unquoted.front()) != std::string::npos &&
        without_mark(unquoted) == layout.columns.front().heading) {
        return 0;
    }
    for (const auto part : {&Column::heading, &Column::name}) {
        for (std::size_t k = 0; found.empty() && k < layout.columns.size(); ++k) {
            if (layout.columns[k].*part != unquoted) continue;
            for (; k < layout.columns.size(); ++k) {
                if (layout.columns[k].*part == unquoted) found.push_back(k);
            }
        }
        if (!found.empty()) break;
    }
    std::size_t index = 0;
    if (found.empty() && parse_index(asked, index) && index >= 1 && index <= layout.columns.size()) return index - 1;
    if (found.size() == 1) return found[0];
    if (found.size() > 1) {
        std::vector<std::string> numbers;
        for (const std::size_t k : found) numbers.push_back(std::to_string(k + 1));
        throw InputError(fmt::format("{}:{}: '{}' is the name of several columns: {}; choose one by its number", file,
                                     layout.line(), shown(asked), listed(numbers)));
    }
    std::vector<std::string> names;
    for (const Column& column : layout.columns) {
        names.push_back(column.heading);
        names.push_back(column.name);
    }
    const std::string near = layout.has_header ? nearest(asked, names) : "";
    throw InputError(fmt::format("{}:{}: has no column '{}'; {}{}", file, layout.line(), shown(asked),
                                 near.empty() ? "" : fmt::format("did you mean '{}'? The ", shown(near)),
                                 columns_text(layout)));
}

}  // namespace ringlock::text
