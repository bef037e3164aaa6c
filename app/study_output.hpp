#pragma once
#include <span>
#include <string>

#include "analysis/report/plot.hpp"
#include "analysis/study/summary.hpp"
#include "app/arguments.hpp"
#include "engine/store/provenance.hpp"

namespace ringlock::app {

/// What `run` and `analyze` print with --json: one object and a newline; what is not shown by the data is null.
std::string study_json(const study::Study& study, const study::Summary& summary, const store::Provenance& provenance);

/// The arm comparison with theory beside it, for people.
std::string study_text(const study::Study& study, const study::Summary& summary, const store::Provenance& provenance);

/// Allan deviations of stored samples (ArmSummary::asked) of all arms, and which of the times asked for are not whole
/// numbers of samples.
std::string asked_text(const study::Study& study, const study::Summary& summary, std::span<const AveragingTime> asked);

/// Allan deviations of all arms; of a sweep, output rate against input rate, or its error where the sweep is so wide
/// that it would not be seen. Beside a closed form, drawn as a line, the simulation is shown as points.
report::Figure study_figure(const study::Study& study, const study::Summary& summary);

}  // namespace ringlock::app
