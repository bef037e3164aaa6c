#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace ringlock::report {

enum class Align { left, right };

struct Column {
    std::string header;
    Align align = Align::left;
};

/// Text table with aligned columns two blanks apart, for people to read.
///
/// Widths are counted in code points of UTF-8, so that cells may hold "±" or "°". No line ends in blanks.
class Table {
   public:
    explicit Table(std::vector<Column> columns);

    /// Adds a row; missing cells at its end stay empty. Throws std::invalid_argument when there are more cells than
    /// columns or a cell holds a line break.
    void add_row(std::vector<std::string> cells);

    /// The headers (left out when all are empty) and the rows, each line begun with `indent` blanks and ended with a
    /// line feed.
    std::string text(std::size_t indent = 0) const;

   private:
    std::vector<Column> columns_;
    std::vector<std::vector<std::string>> rows_;
};

}  // namespace ringlock::report
