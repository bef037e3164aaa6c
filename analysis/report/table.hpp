#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace ringlock::report {

/// Columns of a window that most terminals and pages have.
inline constexpr std::size_t window_columns = 100;

enum class Align { left, right };

struct Column {
    std::string header;
    Align align = Align::left;
};

/// Text table with aligned columns two blanks apart, for people to read.
///
/// Widths are counted in code points of UTF-8, so that cells may hold "±" or "°". No line ends in blanks. Columns that
/// a window of 100 does not hold follow below in a table of their own, which begins with the first column again.
class Table {
   public:
    explicit Table(std::vector<Column> columns);

    /// Adds a row; missing cells at its end stay empty. Throws std::invalid_argument when there are more cells than
    /// columns or a cell holds a line break.
    void add_row(std::vector<std::string> cells);

    /// The headers (left out when all are empty) and the rows, each line begun with `indent` blanks and ended with a
    /// line feed.
    std::string text(std::size_t indent = 0) const;

    const std::vector<Column>& columns() const { return columns_; }
    /// As many cells each as there are columns.
    const std::vector<std::vector<std::string>>& rows() const { return rows_; }

   private:
    std::vector<Column> columns_;
    std::vector<std::vector<std::string>> rows_;
};

}  // namespace ringlock::report
