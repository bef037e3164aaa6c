#include "analysis/record/column_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <span>
#include <string_view>

#include "analysis/record/container.hpp"
#include "analysis/text/table.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {
namespace {

/// Parts between the commas that part names, without white space at their ends.
std::vector<std::string> parts_of_list(const std::string& list) {
    std::vector<std::string> out;
    std::size_t begin = 0;
    int depth = 0;
    bool quoted = false;
    for (std::size_t i = 0; i <= list.size(); ++i) {
        const char c = i < list.size() ? list[i] : ',';
        if (i < list.size() && c == '"') quoted = !quoted;
        if (i == list.size() && quoted) {
            throw InputError(fmt::format("--column {}: a quote does not close", printable(list)));
        }
        if (quoted) continue;
        if (c == '[') ++depth;
        if (c == ']') --depth;
        if (c != ',' || (depth > 0 && i < list.size())) continue;
        out.emplace_back(text::trimmed(std::string_view(list).substr(begin, i - begin)));
        begin = i + 1;
    }
    return out;
}

/// Whether a text has a column with exactly that name.
bool text_has(const SeriesRequest& request, const std::string& name) {
    text::Options options = request.text;
    options.quiet = true;
    const text::Table table(request.path, options, {.names = {name}}, [](std::size_t, std::string_view) {});
    const auto& columns = table.layout().columns;
    return std::any_of(columns.begin(), columns.end(),
                       [&](const text::Column& c) { return c.heading == name || c.name == name; });
}

/// Whether a file of arrays has one with that name: the only way to know is to begin to read it.
bool container_has(SeriesRequest request, const std::string& name) {
    struct Begun {};
    request.column = name;
    request.time = std::nullopt;
    try {
        stream_series(request, [](std::span<const double>) { throw Begun(); });
    } catch (const Begun&) {
        return true;
    } catch (const InputError&) {
        return false;
    }
    return true;
}

/// For what knows no quotes itself.
std::string unquoted(const std::string& name) {
    std::string out;
    for (const char c : name) {
        if (c != '"') out += c;
    }
    return out;
}

}  // namespace

std::vector<std::string> columns_of_list(const SeriesRequest& request, const std::string& list) {
    if (list.find(',') == std::string::npos) return {list};
    const bool is_text = container_of(request.path) == Container::text;
    // Ahead of the parts, so that a name with a single quote mark in it is found, too.
    if (is_text && text_has(request, list)) return {list};
    std::vector<std::string> parts = parts_of_list(list);
    if (!is_text && parts.size() > 1 && container_has(request, list)) return {list};
    for (std::string& part : parts) {
        if (!is_text) part = unquoted(part);
        if (!part.empty()) continue;
        throw InputError(fmt::format("--column {}: a name in the list is empty; names have one comma between them",
                                     printable(list)));
    }
    return parts;
}

}  // namespace ringlock::record
