#pragma once
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "analysis/report/passage.hpp"
#include "analysis/report/plot.hpp"
#include "analysis/study/experiment.hpp"
#include "analysis/study/summary.hpp"
#include "app/arguments.hpp"
#include "engine/store/provenance.hpp"

namespace ringlock::app {

/// The arm comparison with theory next to it, for people; for a design, its points one below the other.
std::string experiment_text(const study::Experiment& experiment, const std::vector<study::Summary>& summaries,
                            const store::Provenance& provenance);

/// Allan deviations of stored samples (ArmSummary::asked) of all arms, and a note on requested times that are not whole
/// numbers of samples.
std::string asked_text(const study::Study& study, const study::Summary& summary, std::span<const AveragingTime> asked);

/// Allan deviations of all arms; for a sweep, output rate against input rate, or the rate error where the sweep is so
/// wide that the error would be invisible. Where a closed form is drawn as a line, the simulation is shown as points.
/// For a design, random walks against its key, or against the number of the point where several keys vary.
report::Figure experiment_figure(const study::Experiment& experiment, const std::vector<study::Summary>& summaries);

/// The deviations of stored samples (ArmSummary::family): one table each, averaging times down, arms across. Empty
/// where no deviations were computed.
std::string family_text(const study::Summary& summary);

/// A rate [deg/h] in the one notation of a column; a value that rounds to zero has no sign.
std::string rate_text(double rate_deg_h);

/// How the points of a design are shown.
struct DesignLayout {
    std::size_t most_columns = 100;  ///< of a table as text; wider ones are divided
    std::size_t most_rows = 40;      ///< of a table; of a longer design some points are left out
    bool names = false;              ///< keys and arms by their names, and not by numbers
};

/// The tables of a design: random walks, rate errors and yields of all points, and the keys that decide.
std::vector<report::Passage> design_passages(const study::Experiment& experiment,
                                             const std::vector<study::Summary>& summaries, const DesignLayout& layout);

/// The tables of one study with their notes.
std::vector<report::Passage> study_passages(const study::Study& study, const study::Summary& summary);

/// The text of one study, below its heading.
std::string study_text(const study::Study& study, const study::Summary& summary);

/// The figure of one study.
report::Figure study_figure(const study::Study& study, const study::Summary& summary);

}  // namespace ringlock::app
