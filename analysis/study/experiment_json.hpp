#pragma once
#include <string>
#include <vector>

#include "analysis/study/experiment.hpp"
#include "analysis/study/summary.hpp"
#include "engine/store/provenance.hpp"

namespace ringlock::study {

/// The output of `run` and `analyze` with --json: one object and a newline; figures that the data do not resolve are
/// null.
std::string experiment_json(const Experiment& experiment, const std::vector<Summary>& summaries,
                            const store::Provenance& provenance);

}  // namespace ringlock::study
