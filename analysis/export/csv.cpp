#include "analysis/export/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <map>

#include "engine/core/interrupt.hpp"

namespace ringlock::exports {
namespace {

using From = Cells::From;

std::string cell_of_value(const store::Values& values, std::uint64_t index) {
    return std::visit(
        [index]<class T>(const std::vector<T>& v) -> std::string {
            const T& value = v.at(index);
            if constexpr (std::same_as<T, std::string>) return cell_of(value);
            if constexpr (std::same_as<T, double>) return std::isnan(value) ? "" : fmt::format("{}", value);
            if constexpr (std::same_as<T, std::int8_t>) return fmt::format("{}", static_cast<int>(value));
            if constexpr (std::integral<T> && sizeof(T) > 1) return fmt::format("{}", value);
        },
        values);
}

bool reads_rows(const Cells& cells) {
    return cells.from == From::by_row || cells.from == From::by_both || cells.from == From::element;
}

/// Datasets of a part: blocks of rows of those that go by row, all of the short ones that go by column.
class PartValues {
   public:
    PartValues(const store::File& file, const TablePart& part) : file_(file), part_(part) {
        std::uint64_t width = 0;
        for (const Cells& cells : part.columns) {
            if (cells.from == From::by_column && !whole_.contains(cells.dataset)) {
                whole_.emplace(cells.dataset, store::read_values(file, *cells.dataset));
            }
            if (reads_rows(cells) && block_.emplace(cells.dataset, store::Values()).second) {
                width += cells.dataset->columns();
            }
        }
        step_ = rows_of_block(width);
    }

    void move_to(std::uint64_t row) {
        if (row < end_ && row >= begin_) return;
        check_interrupt();
        begin_ = row;
        end_ = std::min(part_.rows, row + step_);
        for (auto& [dataset, values] : block_) {
            values = dataset->shape.empty() ? store::read_values(file_, *dataset)
                                            : store::read_values(file_, *dataset, begin_, end_ - begin_);
        }
    }

    std::string cell(const Cells& cells, std::uint64_t row, std::uint64_t inner) const {
        const std::uint64_t divided = row / cells.divisor;
        switch (cells.from) {
            case From::constant:
                return cells.text;
            case From::row_number:
                return fmt::format("{}", cells.first + (cells.modulus > 0 ? divided % cells.modulus : divided));
            case From::inner_number:
                return fmt::format("{}", cells.first + inner);
            case From::by_row:
                return cell_of_value(block_.at(cells.dataset), row - begin_);
            case From::by_column:
                return cell_of_value(whole_.at(cells.dataset),
                                     cells.dataset->shape.size() == 2 ? divided * part_.inner + inner : inner);
            case From::by_both:
                return cell_of_value(block_.at(cells.dataset), (row - begin_) * part_.inner + inner);
            case From::element:
                return cell_of_value(block_.at(cells.dataset),
                                     (row - begin_) * cells.dataset->columns() + cells.column);
            case From::word:
                return cells.words.at(divided % cells.modulus);
            case From::time:
                break;
        }
        return fmt::format("{}", static_cast<double>(inner) * cells.steps.at(cells.steps.size() > 1 ? divided : 0));
    }

   private:
    const store::File& file_;
    const TablePart& part_;
    std::map<const store::ListedObject*, store::Values> whole_;
    std::map<const store::ListedObject*, store::Values> block_;
    std::uint64_t step_ = 1;
    std::uint64_t begin_ = 0;
    std::uint64_t end_ = 0;
};

void write_part(const store::File& file, const TablePart& part, Collected& out) {
    PartValues values(file, part);
    std::string line;
    for (std::uint64_t row = 0; row < part.rows; ++row) {
        values.move_to(row);
        for (std::uint64_t inner = 0; inner < part.inner; ++inner) {
            line.clear();
            for (std::size_t i = 0; i < part.columns.size(); ++i) {
                if (i > 0) line += ',';
                line += values.cell(part.columns[i], row, inner);
            }
            line += '\n';
            out += line;
        }
    }
}

}  // namespace

std::string cell_of(std::string_view text) {
    if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
    std::string out = "\"";
    for (const char c : text) {
        out += c;
        if (c == '"') out += c;
    }
    return out + "\"";
}

void write_csv(const store::File& file, const Table& table, const Sink& sink) {
    Collected out(sink);
    std::string header;
    for (const std::string& name : table.header) header += (header.empty() ? "" : ",") + cell_of(name);
    out += header + "\n";
    for (const TablePart& part : table.parts) write_part(file, part, out);
    out.flush();
}

}  // namespace ringlock::exports
