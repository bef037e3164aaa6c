#include "analysis/report/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "analysis/report/code_points.hpp"

namespace ringlock::report {
namespace {

void check_cell(const std::string& cell) {
    if (cell.find_first_of("\r\n") != std::string::npos) {
        throw std::invalid_argument("a cell of a table holds a line break");
    }
}

}  // namespace

Table::Table(std::vector<Column> columns) : columns_(std::move(columns)) {
    for (const Column& column : columns_) check_cell(column.header);
}

void Table::add_row(std::vector<std::string> cells) {
    if (cells.size() > columns_.size()) {
        throw std::invalid_argument(fmt::format("{} cells in a table of {} columns", cells.size(), columns_.size()));
    }
    for (const std::string& cell : cells) check_cell(cell);
    cells.resize(columns_.size());
    rows_.push_back(std::move(cells));
}

std::string Table::text(std::size_t indent) const {
    std::vector<std::size_t> widths;
    bool headed = false;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
        headed = headed || !columns_[i].header.empty();
        std::size_t width = code_points(columns_[i].header);
        for (const auto& row : rows_) width = std::max(width, code_points(row[i]));
        widths.push_back(width);
    }

    std::string out;
    const auto add_line = [&](std::size_t begin, std::size_t end, const auto& cell_of) {
        std::string line(indent, ' ');
        for (std::size_t i = 0; i < end; ++i) {
            if (i > 0 && i < begin) continue;
            const std::string& cell = cell_of(i);
            const std::string padding(widths[i] - code_points(cell), ' ');
            if (i > 0) line += "  ";
            line += columns_[i].align == Align::right ? padding + cell : cell + padding;
        }
        line.erase(line.find_last_not_of(' ') + 1);
        out += line + '\n';
    };
    for (std::size_t begin = 0; begin == 0 || begin < columns_.size();) {
        // The first column and those from `begin` on that fit the window next to it, but one at least.
        std::size_t used = indent + (widths.empty() ? 0 : widths[0]);
        std::size_t end = std::max<std::size_t>(begin, 1);
        const std::size_t least = end + 1;
        while (end < columns_.size() && (end < least || used + 2 + widths[end] <= window_columns)) {
            used += 2 + widths[end++];
        }
        if (begin > 0) out += '\n';
        if (headed) add_line(begin, end, [&](std::size_t i) -> const std::string& { return columns_[i].header; });
        for (const auto& row : rows_) {
            add_line(begin, end, [&](std::size_t i) -> const std::string& { return row[i]; });
        }
        begin = end;
    }
    return out;
}

}  // namespace ringlock::report
