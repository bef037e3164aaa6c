#pragma once
#include <string>
#include <vector>

#include "analysis/study/experiment.hpp"
#include "analysis/study/summary.hpp"

namespace ringlock::app {

/// The answer of a study, in sentences computed from its data. The first names the arm with the smallest angle random
/// walk, and by which factor those of others are larger, with 95 % intervals; or it says that the data do not decide.
/// Arm `ideal`, which is no cure, takes no part. Of a sweep the first sentence is about the errors of the mean rate.
std::vector<std::string> study_answer(const study::Study& study, const study::Summary& summary);

/// The same of a design: at how many points which arm is best, the smallest random walk of all points, and the key that
/// decides most where the design has sensitivity indices.
std::vector<std::string> design_answer(const study::Experiment& experiment,
                                       const std::vector<study::Summary>& summaries);

}  // namespace ringlock::app
