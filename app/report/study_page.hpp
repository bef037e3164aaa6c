#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "analysis/report/page/page.hpp"
#include "analysis/study/experiment.hpp"
#include "analysis/study/summary.hpp"
#include "engine/store/provenance.hpp"

namespace ringlock::app {

/// A result of `ringlock run` with everything that a page says of it.
struct StudyResult {
    std::filesystem::path file;
    study::Experiment experiment;
    std::vector<study::Summary> summaries;
    store::Provenance provenance;
};

/// Reads and evaluates a result. Throws InputError as study::read_result() does.
StudyResult read_study(const std::filesystem::path& file);

/// The question at the head of a scenario file, and the keys in which the run differs from the file.
struct Question {
    std::string text;
    std::vector<std::string> changed;  ///< a line for each key
};

/// The question of the scenario that the result was made of, where the file is still where the command line named it,
/// or next to the result. Nothing where there is none, or where it is no scenario any more.
std::optional<Question> question_of(const StudyResult& result);

/// The answer in sentences: study_answer() or design_answer().
std::vector<std::string> answer_of(const StudyResult& result);

/// Question, answer, figures and tables.
void add_findings(report::Page& page, const StudyResult& result);
/// Provenance, the command that repeats the run, and the scenario.
void add_provenance(report::Page& page, const StudyResult& result);

}  // namespace ringlock::app
