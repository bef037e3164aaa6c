#pragma once
#include <filesystem>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/report/predictive.hpp"

namespace ringlock::report {

/// Writes report.md into the folder, a page about the record `source` for people who have not read docs/closure.md, and
/// its figures beside it: allan.svg, spectrum.svg and, of turns, folded.svg, each the measured record over the band of
/// the simulations; steps.svg, the held-out error step by step. Where gnuplot is missing or fails the page says so and
/// does without them.
///
/// Throws InputError where the page cannot be written there, RunError where the disk refuses.
void write_closure_page(const std::filesystem::path& folder, const std::string& source, const closure::Closure& closure,
                        const closure::Predictive& predictive);

}  // namespace ringlock::report
