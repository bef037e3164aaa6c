#pragma once
#include <vector>

#include "analysis/report/plot.hpp"
#include "analysis/study/study.hpp"
#include "analysis/study/summary.hpp"

namespace ringlock::app {

/// How random walk, mean rate error and what a specification limits are distributed over the gyros: a figure each, with
/// a curve for each arm. A point at (x, p) says that the share p of the gyros has at most x; of many gyros some are
/// left out. Limits are vertical lines. Empty in sweeps and for fewer than four gyros.
std::vector<report::Figure> lot_distributions(const study::Study& study, const study::Summary& summary);

}  // namespace ringlock::app
