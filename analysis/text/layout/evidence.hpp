#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/text/fields.hpp"
#include "analysis/text/layout/layout.hpp"

/// Structure of the lines of a text in a dialect.
namespace ringlock::text {

/// The lines of a sample that may be rows in a dialect: neither empty nor comments nor skipped.
struct Candidates {
    std::vector<std::string_view> lines;
    std::vector<std::size_t> numbers;  ///< of each in the file, from 1
};
Candidates candidates_of(const std::vector<std::string>& sample, std::size_t skip, const Dialect& dialect);

/// Common structure of the rows.
struct Evidence {
    Dialect dialect;
    std::size_t columns = 0;    ///< of most rows with numbers; 0 without such rows
    std::vector<bool> numeric;  ///< which columns hold numbers
    double score = 0.0;         ///< rows of that many columns, times the share of numbers in them
    std::size_t others = 0;     ///< rows without values, or with another number of fields
    bool header_fits = false;   ///< the row above the first has as many fields
    bool last_empty = false;    ///< no row has anything in the last column
};
Evidence evidence_for(const Dialect& dialect, const Candidates& candidates);

/// The dialect that explains the lines best; `delimiter`, where it is given, is not in question.
Evidence best_evidence(const std::vector<std::string>& sample, const Options& options);

/// Agreement of a row with the columns of the evidence.
enum class RowKind {
    other,  ///< another number of fields
    words,  ///< no number where numbers are
    mixed,  ///< numbers in some of the columns of numbers, words in others
    empty,  ///< nothing in any field
    data,
};
RowKind kind_of(const std::vector<std::string_view>& fields, const Evidence& evidence);

/// A value, or a word for a missing value; an empty field is no value.
bool is_value(std::string_view field, const Dialect& dialect);

}  // namespace ringlock::text
