#pragma once
#include <string>
#include <string_view>

namespace ringlock::report {

/// A literal of gnuplot. All but letters and blanks is written as octal codes (digits too, they would prolong a code):
/// nothing in it can end the string, be expanded or be run.
std::string literal(std::string_view text);

/// Runs gnuplot on a script whose figure goes to standard output, and returns the figure, complete.
///
/// Settings of the user (~/.gnuplot) are not read. `shown_as` names the figure in errors. Throws RunError when gnuplot
/// is missing or fails (with what it said), Interrupted where the user asks to stop.
std::string run_gnuplot(const std::string& script, const std::string& shown_as);

}  // namespace ringlock::report
