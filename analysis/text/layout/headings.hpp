#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/text/fields.hpp"

namespace ringlock::text {

/// A line as the headings of that many columns: divided as the rows are or, where that gives another number, at tabs or
/// two blanks, with units in brackets as parts of the headings before them, or at another delimiter. By white space a
/// line with one heading too few names the columns behind the first, as R writes it; elsewhere, with `last_empty`,
/// where a delimiter too many ends all rows, those before the last. Empty where the line cannot be that.
std::vector<std::string> headings(std::string_view line, const Dialect& dialect, std::size_t columns,
                                  bool last_empty = false);

}  // namespace ringlock::text
