#pragma once
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/report/predictive.hpp"
#include "analysis/record/record.hpp"
#include "analysis/report/plot.hpp"

namespace ringlock::report {

/// A figure of the report of a closed loop.
struct Picture {
    std::string file;     ///< its name
    std::string caption;  ///< Markdown
    Figure figure;
};

/// The figures of a report, in its order: the rate over time with the effects that were found, the statistics of the
/// predictive check, each line that was found, the held-out error step by step.
/// \param source  name of the record
std::vector<Picture> closure_pictures(const std::string& source, const record::Record& record,
                                      const closure::Closure& closure, const closure::Predictive& predictive);

/// Those of the predictive check alone.
std::vector<Picture> predictive_pictures(const std::string& source, const closure::Predictive& predictive);

/// The held-out error step by step alone.
Picture step_picture(const std::string& source, const closure::Closure& closure);

}  // namespace ringlock::report
