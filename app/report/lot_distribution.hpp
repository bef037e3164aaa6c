#pragma once
#include <vector>

#include "analysis/report/plot.hpp"
#include "analysis/study/study.hpp"
#include "analysis/study/summary.hpp"

namespace ringlock::app {

/// The distributions of the random walk, of the mean rate error and of the figures with a specified limit over the
/// gyros: a figure each, with a curve for each arm. A point at (x, p) says that the share p of the gyros has at most x;
/// of many gyros some are left out. Limits are vertical lines. Empty in sweeps and for fewer than four gyros.
std::vector<report::Figure> lot_distributions(const study::Study& study, const study::Summary& summary);

}  // namespace ringlock::app
