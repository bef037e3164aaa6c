#pragma once
#include <vector>

#include "analysis/report/page/page.hpp"
#include "app/allan/output/allan_output.hpp"

namespace ringlock::app {

/// The coefficients of the series, in a sentence each.
std::vector<std::string> allan_answer(const std::vector<AllanOutput>& series);

/// Answer, figure, coefficients and findings of the series of `ringlock allan --json`.
void add_allan_analysis(report::Page& page, const std::vector<AllanOutput>& series);

/// The options of `ringlock allan` that are known from the JSON, as a command, in which DATA stands for an unknown
/// name.
std::string allan_command(const std::vector<AllanOutput>& series);

}  // namespace ringlock::app
