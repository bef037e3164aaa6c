#pragma once
#include <optional>
#include <string>
#include <vector>

#include "analysis/report/plot.hpp"
#include "app/allan/output/allan_output.hpp"
#include "app/allan/output/hat_output.hpp"

namespace ringlock::app {

/// Short names of series that tell them apart: of the columns where all are of one file, of the files where each has
/// one column in it, else of both. Not yet printable().
std::vector<std::string> names_of_series(const std::vector<AllanOutput>& series);

/// Tables of every series, explained where that is asked for; where there are several with a unit, one of their
/// coefficients; and the three-cornered hat.
std::string series_text(const std::vector<AllanOutput>& series, bool explain, const std::optional<HatOutput>& hat);

/// The object of the only series or, of several, one with the member `series`: their objects, each with its file
/// (`data`). Explanations are `explanation` of a series, the hat is the member `hat`. And a newline.
std::string series_json(const std::vector<AllanOutput>& series, bool explain, const std::optional<HatOutput>& hat);

/// The figure of the only series, or that of several: deviations with their intervals and, in the same colour, the sum
/// of the terms that were fitted.
report::Figure series_figure(const std::vector<AllanOutput>& series);

}  // namespace ringlock::app
