#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "engine/store/contents.hpp"

/// How the datasets of a file make tables of rows and columns.
namespace ringlock::exports {

/// Where a column of a part of a table takes its cells from. A part has `rows` times `inner` lines; the line of row r
/// and inner number c has of
///
/// - constant: the text; empty for columns that only other parts have
/// - number: first + (r div divisor) mod modulus, or c
/// - by_row: values[r] of a dataset of `rows` rows
/// - by_column: values[c] of a dataset of `inner` elements; of one in two dimensions row r div divisor
/// - by_both: values[r][c]
/// - element: values[r][column]
/// - time: c times the element r div divisor of `steps`
/// - word: the element r mod modulus of `words`
struct Cells {
    enum class From { constant, row_number, inner_number, by_row, by_column, by_both, element, time, word };

    From from = From::constant;
    std::string text = {};
    const store::ListedObject* dataset = nullptr;
    std::uint64_t column = 0;
    std::uint64_t first = 0;
    std::uint64_t divisor = 1;
    std::uint64_t modulus = 0;  ///< 0: none
    std::vector<double> steps = {};
    std::vector<std::string> words = {};
};

/// Lines that lie below each other in a table and come from the same datasets, as those of one arm.
struct TablePart {
    std::uint64_t rows = 0;
    std::uint64_t inner = 1;
    std::vector<Cells> columns;  ///< as many as the table has
};

/// A table of a file. It refers to the list of objects that it was made of.
struct Table {
    std::string name;
    std::string content;  ///< in words
    std::vector<std::string> header;
    std::vector<TablePart> parts;

    std::uint64_t lines() const;
};

/// The tables of a file, the one that most readers want first; every dataset stands in one of them, and the attributes
/// of all objects in the last. `objects` is all that the file has and must outlive the tables. Small datasets that name
/// columns are read.
std::vector<Table> tables_of(const store::File& file, const std::vector<store::ListedObject>& objects);

}  // namespace ringlock::exports
