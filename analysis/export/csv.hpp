#pragma once
#include "analysis/export/blocks.hpp"
#include "analysis/export/tables.hpp"

namespace ringlock::exports {

/// The table by RFC 4180, with lines that end in LF: a line of names, then one for each row. Numbers have all their
/// digits; a cell is empty where there is no number (NaN), and inf or -inf where it is infinite.
void write_csv(const store::File& file, const Table& table, const Sink& sink);

/// A cell of text, in quotes where it holds a comma, a quote or the end of a line.
std::string cell_of(std::string_view text);

}  // namespace ringlock::exports
