#pragma once
#include <filesystem>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/report/predictive.hpp"

namespace ringlock::report {

/// An estimate with its standard error, "12.3 ± 0.4", or why it has none.
std::string estimate_text(const closure::Estimate& estimate);

/// Writes report.md into the folder, a page about the record `source` for people who have not read docs/closure.md, and
/// its figures (closure_figures.hpp). Figures of an earlier report that this one does not have are removed. Where
/// gnuplot is missing or fails the page says so and has no figures.
///
/// Throws InputError where the page cannot be written there, RunError where the disk refuses.
void write_closure_page(const std::filesystem::path& folder, const std::string& source, const record::Record& record,
                        const closure::Closure& closure, const closure::Predictive& predictive);

}  // namespace ringlock::report
