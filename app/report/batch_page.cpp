#include "app/report/batch_page.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "app/report/study_page.hpp"
#include "app/run/slurm_script.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/read_json.hpp"

namespace ringlock::app {

namespace {

namespace fs = std::filesystem;
using report::Align;
using report::Table;

/// A line of batch.json.
struct BatchRun {
    std::string scenario;
    std::string result;
    std::string state;
    std::string error;
    std::int64_t gyros = 0;
    double wall_s = 0.0;
};

std::vector<BatchRun> runs_in(const nlohmann::json& object) {
    std::vector<BatchRun> runs;
    for (const nlohmann::json& one : object.at("runs")) {
        BatchRun run;
        run.scenario = one.at("scenario").get<std::string>();
        run.result = one.at("result").get<std::string>();
        run.state = one.at("state").get<std::string>();
        if (!one.at("error").is_null()) run.error = one.at("error").get<std::string>();
        run.gyros = one.at("gyros").get<std::int64_t>();
        run.wall_s = number_or_nan(one.at("wall_s"));
        runs.push_back(std::move(run));
    }
    if (runs.empty()) throw InputError("runs: is empty; a batch has scenarios");
    return runs;
}

/// The name of a result on the page: that of its scenario.
std::string title_of(const StudyResult& result) {
    const fs::path scenario = result.provenance.scenario_file;
    return scenario.empty() ? result.file.filename().string() : scenario.filename().string();
}

void add_results(report::Page& page, const std::vector<StudyResult>& results) {
    Table table({{"study"}, {"answer"}});
    for (const StudyResult& result : results) {
        table.add_row({printable(title_of(result)), printable(answer_of(result).front())});
    }
    page.table(table, "Answers");
    for (const StudyResult& result : results) {
        page.heading(title_of(result));
        add_findings(page, result);
        page.subheading("Provenance");
        add_provenance(page, result);
    }
}

}  // namespace

report::Page results_page(const std::vector<fs::path>& files, const std::string& title) {
    std::vector<StudyResult> results;
    for (const fs::path& file : files) results.push_back(read_study(file));
    report::Page page(title, "Batch");
    add_results(page, results);
    return page;
}

report::Page batch_page(const fs::path& folder) {
    std::vector<BatchRun> runs;
    read_json(folder / "batch.json", "batch.json of ringlock run with several scenarios",
              [&](const nlohmann::json& object) { runs = runs_in(object); });
    report::Page page(fmt::format("Batch of {} scenarios", runs.size()), "Batch");
    Table table({{"scenario"}, {"state"}, {"gyros", Align::right}, {"wall time [s]", Align::right}, {"remark"}});
    std::vector<StudyResult> results;
    std::string command = "ringlock run";
    for (const BatchRun& run : runs) {
        command += " " + shell_quoted(run.scenario);
        std::string remark = run.error;
        if (run.error.empty()) {
            // The folder may have been moved since the batch.
            const fs::path result = folder / fs::path(run.result).filename();
            std::error_code unknown;
            if (!fs::exists(result, unknown)) {
                remark = "its result is not in the folder";
            } else {
                results.push_back(read_study(result));
            }
        }
        table.add_row({printable(run.scenario), printable(run.state), fmt::format("{}", run.gyros),
                       std::isfinite(run.wall_s) ? fmt::format("{:.3g}", run.wall_s) : "", printable(remark)});
    }
    page.table(table, "Scenarios of the batch");
    if (!results.empty()) add_results(page, results);
    page.heading("The batch again");
    page.paragraph("The command, started where the batch was; settings that it had are in the commands above:");
    page.code(command + " -o " + shell_quoted(folder.string()) + "\n", "Command");
    return page;
}

}  // namespace ringlock::app
