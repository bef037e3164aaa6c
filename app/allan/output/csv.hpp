#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "app/allan/output/allan_output.hpp"

/// Tables for other programs: RFC 4180 with lines that end in LF; numbers have all their digits, and a cell is empty
/// where there is no number.
namespace ringlock::app {

/// A cell, in quotes where it holds a comma, a quote or the end of a line.
std::string csv_cell(std::string_view text);
/// A number that reads back as itself; empty where it is not finite.
std::string csv_cell(double value);

/// One line of a table, its end included; the cells are ready.
std::string csv_line(const std::vector<std::string>& cells);

/// How the unit of rates, or of times and angles (`integral`), stands in the name of a column: "_deg_h", "_arcsec";
/// empty where it is 1 or not known.
std::string unit_suffix(const AllanOutput& out, bool integral);

/// The deviations of all series, a row for each point: file, column, deviation, m, tau_s, dev, lo, hi with their unit
/// (deviations of time in columns of their own), terms, alpha, edf, bias.
std::string deviations_csv(const std::vector<AllanOutput>& series);

}  // namespace ringlock::app
