#pragma once
#include <filesystem>
#include <string>

#include "analysis/closure/report/read_report.hpp"
#include "analysis/report/page/page.hpp"

namespace ringlock::app {

/// Verdict, steps with the held-out error before and after, figures, parameters, predictive check and tests of one
/// record.
void add_closed_loop(report::Page& page, const closure::Report& report);

/// The page of a folder that `ringlock closure -o` has written, of one record or of a data chain. Throws InputError
/// where a file of it is missing or damaged.
report::Page closed_loop_page(const std::filesystem::path& folder);

}  // namespace ringlock::app
