#pragma once
#include <span>
#include <string>
#include <vector>

#include "analysis/report/plot.hpp"
#include "analysis/study/experiment.hpp"
#include "analysis/study/summary.hpp"
#include "app/arguments.hpp"
#include "engine/store/provenance.hpp"

namespace ringlock::app {

/// What `run` and `analyze` print with --json: one object and a newline; what is not shown by the data is null.
std::string experiment_json(const study::Experiment& experiment, const std::vector<study::Summary>& summaries,
                            const store::Provenance& provenance);

/// The arm comparison with theory beside it, for people; of a design, its points one below the other.
std::string experiment_text(const study::Experiment& experiment, const std::vector<study::Summary>& summaries,
                            const store::Provenance& provenance);

/// Allan deviations of stored samples (ArmSummary::asked) of all arms, and which of the times asked for are not whole
/// numbers of samples.
std::string asked_text(const study::Study& study, const study::Summary& summary, std::span<const AveragingTime> asked);

/// Allan deviations of all arms; of a sweep, output rate against input rate, or its error where the sweep is so wide
/// that it would not be seen. Beside a closed form, drawn as a line, the simulation is shown as points. Of a design,
/// random walks against its key, or against the number of the point where several keys vary.
report::Figure experiment_figure(const study::Experiment& experiment, const std::vector<study::Summary>& summaries);

/// The deviations of stored samples (ArmSummary::family): one table each, averaging times down, arms across. Empty
/// where there are none.
std::string family_text(const study::Summary& summary);

/// A rate [deg/h] in the one notation of a column; what rounds to zero has no sign.
std::string rate_text(double rate_deg_h);

/// The text of one study, below its heading.
std::string study_text(const study::Study& study, const study::Summary& summary);

/// The figure of one study.
report::Figure study_figure(const study::Study& study, const study::Summary& summary);

}  // namespace ringlock::app
