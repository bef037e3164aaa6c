#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/report/table.hpp"

namespace ringlock::report {

/// A piece of a report: a table with the lines around it. Commands print passages as text, and pages show them as HTML.
struct Passage {
    std::string heading = {};  ///< a line, or two; empty: none
    std::string before = {};   ///< lines between heading and table, each ended with a line feed
    std::optional<Table> table = {};
    std::string notes = {};  ///< lines below the table, likewise
};

/// All of them one below the other with an empty line between two.
std::string text_of(std::span<const Passage> passages);

/// The same of one.
std::string text_of(const Passage& passage);

/// The lines of a text, without their ends; lines that are empty are left out.
std::vector<std::string> lines_of(const std::string& text);

}  // namespace ringlock::report
