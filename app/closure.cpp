#include "analysis/closure/closure.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <exception>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/report/folder.hpp"
#include "analysis/closure/report/report.hpp"
#include "analysis/record/record.hpp"
#include "analysis/report/closure_page.hpp"
#include "app/command.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/record_output.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/parse.hpp"

namespace ringlock::app {

namespace {

/// What the record does not declare, the scenario says.
void declare(record::Declared& declared, const scenario::Scenario& model) {
    const auto fill = [](std::optional<double>& to, double value) {
        if (!to) to = value;
    };
    fill(declared.scale_factor_arcsec, model.gyro.scale_factor_arcsec);
    fill(declared.lockin_threshold_deg_h, model.gyro.lockin_threshold_deg_h);
    fill(declared.dither_frequency_hz, model.dither.frequency_hz);
    fill(declared.dither_peak_rate_deg_s, model.dither.peak_rate_deg_s);
}

/// Refuses, before the work, an output folder in which somebody's file would be lost.
void refuse_to_lose(const std::string& record, const std::string& model, const std::string& folder) {
    std::vector<NamedFile> files{{"RECORD", record, NamedFile::Use::input}, {"--model", model, NamedFile::Use::input}};
    for (const std::filesystem::path& file : closure::files_of(folder)) {
        files.push_back({"-o", file, NamedFile::Use::output});
    }
    refuse_same_files(files);
    closure::check_folder(folder);
}

/// Shows the stage of the loop and the time since it began: one line that is replaced on a terminal, a line for each
/// stage elsewhere.
class StageProgress {
   public:
    explicit StageProgress(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}
    ~StageProgress() {
        if (shown_ && terminal_) tell("\r\033[K");
    }
    StageProgress(const StageProgress&) = delete;
    StageProgress& operator=(const StageProgress&) = delete;

    void show(const std::string& stage) {
        if (quiet_) return;
        const std::chrono::duration<double> since = std::chrono::steady_clock::now() - start_;
        const std::string line = fmt::format("{:4.0f} s  {}", since.count(), stage);
        tell(terminal_ ? "\r\033[K" + line + " ..." : line + "\n");
        shown_ = true;
    }

   private:
    bool quiet_;
    bool terminal_;
    bool shown_ = false;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

void add_closure(CLI::App& root) {
    struct Arguments {
        std::string record;
        std::string model;
        std::string out;
        bool json = false;
        bool quiet = false;
    };
    CLI::App* command = root.add_subcommand("closure", "Identify the error sources in a measured record");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("RECORD", arguments->record, "rlg-record (.h5), or samples as text")->required();
    command->add_option("--model", arguments->model,
                        "scenario (.toml) that supplies scale factor, threshold and dither where the record does not "
                        "declare them");
    command->add_option("-o,--output", arguments->out,
                        "folder for report.md with its figures, closed.toml, closure.h5 and closure.json");
    command->add_flag("--json", arguments->json, "one JSON object on standard output");
    command->add_flag("-q,--quiet", arguments->quiet, "no progress on standard error");
    command->callback([arguments] {
        if (!arguments->out.empty()) refuse_to_lose(arguments->record, arguments->model, arguments->out);
        record::Record record = record::read_record(arguments->record);
        tell_warnings(arguments->record, record);
        if (!arguments->model.empty()) declare(record.declared, scenario::parse_file(arguments->model));
        StageProgress progress(arguments->quiet);
        const closure::Monitor monitor{[&](const std::string& stage) { progress.show(stage); }};
        closure::Closure closure;
        try {
            closure = closure::close_loop(record, monitor);
        } catch (const InputError& error) {
            throw InputError(fmt::format("{}: {}", arguments->record, error.what()));
        }
        nlohmann::json json = closure::to_json(closure);
        json["closed"] = closure::to_json(closure::closed_scenario(record, closure));
        std::string text = closure::to_text(closure);
        std::exception_ptr not_written;
        if (!arguments->out.empty()) {
            const std::string name = std::filesystem::path(arguments->record).filename().string();
            monitor.tell("simulating the closed model");
            const closure::Predictive predictive = closure::check_predictive(record, closure);
            json["predictive"] = closure::to_json(predictive);
            text += "\n" + closure::to_text(predictive);
            try {
                closure::write_closure(arguments->out, name, record, closure, predictive);
                report::write_closure_page(arguments->out, name, record, closure, predictive);
            } catch (const Interrupted&) {
                throw;
            } catch (...) {
                not_written = std::current_exception();  // what was found is printed all the same
            }
        }
        put(arguments->json ? json.dump() + "\n" : text);
        if (not_written) std::rethrow_exception(not_written);
    });
}

}  // namespace ringlock::app
