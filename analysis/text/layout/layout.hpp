#pragma once
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/text/fields.hpp"
#include "analysis/text/options.hpp"

/// Where in a text the table is, and how it is written.
namespace ringlock::text {

struct Column {
    std::string heading;  ///< as the header has it, without quotes; the number from 1 where there is no header
    std::string name;     ///< the heading without its unit
    std::string unit;     ///< that the header or the row below it declares; empty where none does
};

struct Layout {
    Dialect dialect;
    std::vector<Column> columns;  ///< none where the text has no rows
    bool has_header = false;
    std::size_t header_line = 0;  ///< from 1; 0 without a header
    std::size_t first_line = 0;   ///< of the first row, from 1; 0 without rows
    std::vector<std::string> notes;

    /// A line for messages about the columns as a whole.
    std::size_t line() const { return header_line > 0 ? header_line : first_line; }
};

/// The columns that will be requested, which help to distinguish a header from data.
struct Wanted {
    std::vector<std::string> names;  ///< or numbers from 1
    bool header_needed = false;      ///< only names count, and a row of text above numbers is the header
};

/// Finds the table among the first lines of a text. `name` is that of the file. Throws InputError, naming the line,
/// where options do not fit it or a row of numbers above the table has another number of fields.
Layout find_layout(const std::vector<std::string>& lines, const Options& options, const Wanted& wanted,
                   const std::string& name);

}  // namespace ringlock::text
