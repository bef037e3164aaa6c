#include "app/report/study_page.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <fstream>
#include <string_view>
#include <system_error>
#include <utility>

#include "analysis/report/passage.hpp"
#include "analysis/study/result/result_file.hpp"
#include "app/failure.hpp"
#include "app/report/answer.hpp"
#include "app/report/lot_distribution.hpp"
#include "app/study/study_output.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/text/differences.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/render.hpp"

namespace ringlock::app {

namespace {

namespace fs = std::filesystem;

/// Rows of a table of points on a page: more would make it larger than anybody reads.
constexpr std::size_t most_points_shown = 400;

/// The comment at the head of a scenario from "Question:" to "Answer:" or to the end of its paragraph.
std::string question_in(const fs::path& file) {
    std::ifstream in(file);
    std::string line;
    std::string question;
    constexpr std::string_view mark = "Question:";
    while (std::getline(in, line) && line.starts_with('#')) {
        const std::size_t begin = line.find_first_not_of("# \t");
        if (begin == std::string::npos) {
            if (!question.empty()) break;
            continue;
        }
        std::string text = line.substr(begin);
        if (text.starts_with("Answer:")) break;
        if (question.empty()) {
            if (!text.starts_with(mark)) continue;
            const std::size_t words = text.find_first_not_of(' ', mark.size());
            text = words == std::string::npos ? std::string() : text.substr(words);
        }
        question += (question.empty() ? "" : " ") + text;
    }
    return question;
}

/// Lines of a text as paragraphs: a line that goes on belongs to the one before.
void add_lines(report::Page& page, const std::string& text) {
    std::string paragraph;
    for (const std::string& line : report::lines_of(text)) {
        paragraph += (paragraph.empty() ? "" : " ") + line;
        if (line.ends_with(';')) continue;
        page.paragraph(paragraph);
        paragraph.clear();
    }
    page.paragraph(paragraph);
}

void add_passages(report::Page& page, const std::vector<report::Passage>& passages) {
    for (const report::Passage& passage : passages) {
        std::string heading;
        for (const std::string& line : report::lines_of(passage.heading))
            heading += (heading.empty() ? "" : " ") + line;
        if (!passage.table) page.paragraph(heading);
        add_lines(page, passage.before);
        if (passage.table) page.table(*passage.table, heading);
        add_lines(page, passage.notes);
    }
}

void add_study_figures(report::Page& page, const StudyResult& result) {
    const study::Experiment& experiment = result.experiment;
    const bool sweep = !result.summaries.front().arms.front().sweep.empty();
    page.chart(experiment_figure(experiment, result.summaries),
               experiment.has_design() ? "Bars are bootstrap 95 % intervals of the medians."
               : sweep                 ? ""
                                       : "Bars are 68.27 % intervals of the deviation over all gyros.");
    if (experiment.has_design()) return;
    for (report::Figure& figure : lot_distributions(experiment.points.front(), result.summaries.front())) {
        page.chart(std::move(figure), "One point is one gyro; of many gyros some are left out.");
    }
}

std::string duration_words(const StudyResult& result) {
    const study::Study& first = result.experiment.points.front();
    const double duration_s = first.schedule.sample_interval_s * static_cast<double>(first.schedule.samples - 1);
    if (result.experiment.has_design()) {
        return fmt::format("{} points of {} gyros", result.experiment.points.size(),
                           result.experiment.scenario.ensemble.gyros);
    }
    return fmt::format("{} gyros, {:.6g} s each", first.gyros.size(), duration_s);
}

}  // namespace

StudyResult read_study(const fs::path& file) {
    StudyResult result{file, study::read_result(file), {}, study::read_provenance(file)};
    name_file_of_values(file.string(), [&] { result.summaries = study::summarise(result.experiment); });
    return result;
}

std::optional<Question> question_of(const StudyResult& result) {
    const fs::path named = result.provenance.scenario_file;
    for (const fs::path& file : {named, result.file.parent_path() / named.filename()}) {
        std::error_code unknown;
        if (file.extension() != ".toml" || !fs::is_regular_file(file, unknown)) continue;
        try {
            const scenario::Scenario written = scenario::parse_file(
                file, {}, [](const scenario::Scenario&) { return std::vector<scenario::Complaint>(); });
            Question question{question_in(file), {}};
            if (question.text.empty()) continue;
            for (std::string& line : scenario::differences(written, result.experiment.scenario)) {
                // A stopping rule replaces the number of gyros.
                if (!(result.experiment.growth && line.starts_with("ensemble.gyros"))) {
                    question.changed.push_back(std::move(line));
                }
            }
            return question;
        } catch (const InputError&) {
            continue;  // it has become another file
        }
    }
    return std::nullopt;
}

std::vector<std::string> answer_of(const StudyResult& result) {
    return result.experiment.has_design() ? design_answer(result.experiment, result.summaries)
                                          : study_answer(result.experiment.points.front(), result.summaries.front());
}

void add_findings(report::Page& page, const StudyResult& result) {
    if (const std::optional<Question> question = question_of(result)) {
        page.answer("Question", {question->text});
        if (!question->changed.empty()) {
            page.paragraph(
                "The question is that of the scenario file, which differs from this run (file before, run now):");
            page.list(question->changed);
        }
    }
    page.answer("Answer", answer_of(result));
    page.paragraph(fmt::format("{}, seed {}, {} turns of the dither.", duration_words(result),
                               result.experiment.scenario.ensemble.seed, result.experiment.turns()));
    if (result.experiment.growth) {
        page.paragraph(fmt::format("The lot stopped growing at {} gyros: {}", result.experiment.growth->looks.back(),
                                   result.experiment.growth->why));
    }
    add_study_figures(page, result);
    DesignLayout layout;
    layout.most_columns = static_cast<std::size_t>(-1);
    layout.most_rows = most_points_shown;
    layout.names = true;
    add_passages(page, result.experiment.has_design()
                           ? design_passages(result.experiment, result.summaries, layout)
                           : study_passages(result.experiment.points.front(), result.summaries.front()));
}

void add_provenance(report::Page& page, const StudyResult& result) {
    const store::Provenance& from = result.provenance;
    std::vector<std::pair<std::string, std::string>> rows{
        {"result", result.file.string()},
        {"scenario", from.scenario_file},
        {"seed", fmt::format("{}", result.experiment.scenario.ensemble.seed)},
        {"program", fmt::format("ringlock {} ({}), {}, HDF5 {}", from.program_version, from.git_hash, from.compiler,
                                from.hdf5_version)},
        {"instruction set", from.instruction_set.empty() ? "not recorded" : from.instruction_set},
        {"host and date", fmt::format("{}, {}", from.host, from.date_utc)},
        {"wall time", fmt::format("{:.4g} s on {} threads, {:.3g} turns a second", from.wall_s, from.threads,
                                  static_cast<double>(result.experiment.turns()) / from.wall_s)}};
    page.facts(rows, "Provenance");
    page.paragraph("The command that made the result, and makes it again:");
    page.code(from.command_line + "\n", "Command");
    page.folded_code("The full scenario of the run, which ringlock run reads",
                     scenario::to_toml(result.experiment.scenario));
}

}  // namespace ringlock::app
