#pragma once
#include <string>

#include "analysis/report/plot.hpp"
#include "app/allan/output/allan_output.hpp"

namespace ringlock::app {

/// Deviations with their intervals; where the noise of a gyro was fitted and Allan deviations are shown, each term of
/// the fit as a line and their sum.
report::Figure allan_figure(const AllanOutput& out);

// Of several series in one figure.

/// Labels and scales by the unit and the deviations of the series.
void set_axes(const AllanOutput& out, report::Figure& figure);

/// Adds the deviations of a series and, in the colour of the first that estimates the Allan variance, the sum of the
/// fitted terms as a line without an entry in the legend.
void add_series(const AllanOutput& out, const std::string& name, report::Figure& figure);

}  // namespace ringlock::app
