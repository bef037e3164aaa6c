#pragma once
#include "analysis/report/plot.hpp"
#include "app/allan_output.hpp"

namespace ringlock::app {

/// Deviations with their intervals; where the noise of a gyro was fitted and Allan deviations are shown, each term of
/// the fit as a line and their sum.
report::Figure allan_figure(const AllanOutput& out);

}  // namespace ringlock::app
