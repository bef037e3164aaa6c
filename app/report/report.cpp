#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "analysis/record/record.hpp"
#include "analysis/report/page/page.hpp"
#include "app/allan/output/read_allan.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/report/allan_page.hpp"
#include "app/report/batch_page.hpp"
#include "app/report/closed_loop_page.hpp"
#include "app/report/study_page.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/read_json.hpp"

namespace ringlock::app {

namespace {

namespace fs = std::filesystem;

struct ReportArguments {
    std::vector<std::string> inputs;
    std::string out;
};

constexpr const char* inputs_allowed =
    "report takes a result of ringlock run, a folder of ringlock closure -o or of a batch, or what ringlock allan "
    "--json "
    "has printed into a file";

/// A path without the separator at its end, by which a folder has a name.
fs::path named(const fs::path& path) {
    fs::path name = path.has_filename() ? path : path.parent_path();
    if (name == "." || name == "..") name = fs::absolute(name).lexically_normal();
    return name.has_filename() ? name : name.parent_path();
}

/// Next to the first input.
fs::path page_of(const ReportArguments& arguments) {
    if (!arguments.out.empty()) return arguments.out;
    const fs::path first = named(arguments.inputs.front());
    if (arguments.inputs.size() > 1) return first.parent_path() / "batch.report.html";
    std::error_code unknown;
    fs::path page = first;
    if (!fs::is_directory(first, unknown)) page.replace_extension();
    return page += ".report.html";
}

/// A page replaces an earlier one, and nothing else.
void refuse_to_lose_other(const fs::path& page) {
    const std::string extension = page.extension().string();
    if (extension != ".html" && extension != ".htm") {
        throw InputError(fmt::format("-o {}: a report is a page of HTML; its name must end in .html", printable(page)));
    }
    std::error_code unknown;
    if (!fs::is_regular_file(page, unknown)) return;  // AtomicPath says what cannot be written
    std::ifstream in(page, std::ios::binary);
    std::string head(4096, '\0');
    in.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(in.gcount()));
    if (head.empty() || head.find("<meta name=\"generator\" content=\"ringlock ") != std::string::npos) return;
    throw InputError(fmt::format(
        "{}: would be replaced, but ringlock report did not write it; it is kept. Give another file with -o",
        printable(page)));
}

report::Page study_page(const fs::path& file) {
    const StudyResult result = read_study(file);
    const fs::path scenario = result.provenance.scenario_file;
    report::Page page(scenario.empty() ? file.filename().string() : scenario.string(), "Study");
    add_findings(page, result);
    page.heading("Provenance");
    add_provenance(page, result);
    return page;
}

report::Page allan_page(const fs::path& file, const nlohmann::json& object) {
    std::vector<AllanOutput> series = allan_outputs_of(object);
    const std::string command = allan_command(series);
    for (AllanOutput& out : series) {
        if (out.data.empty()) out.data = file.filename().string();
    }
    report::Page page(file.filename().string(), "Allan analysis");
    add_allan_analysis(page, series);
    page.heading("Provenance");
    page.paragraph(
        "The JSON does not hold the whole command. These are the options that follow from it; DATA and UNIT stand for "
        "what it does not name:");
    page.code(command + "\n", "Command");
    return page;
}

report::Page page_of_json(const fs::path& file) {
    std::optional<report::Page> page;
    bool of_folder = false;
    bool of_batch = false;
    read_json(file, "the output of ringlock allan --json", [&](const nlohmann::json& object) {
        if (is_allan_object(object)) {
            page = allan_page(file, object);
        } else if (object.is_object() && file.filename() == "closure.json") {
            of_folder = true;
        } else if (object.is_object() && file.filename() == "batch.json") {
            of_batch = true;
        } else {
            throw InputError(fmt::format("is not what ringlock allan --json prints; {}", inputs_allowed));
        }
    });
    if (of_folder) return closed_loop_page(file.parent_path());
    if (of_batch) return batch_page(file.parent_path());
    return *page;
}

/// Results in a folder, by name.
std::vector<fs::path> results_in(const fs::path& folder) {
    std::vector<fs::path> files;
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
        if (entry->path().extension() != ".h5" || !entry->is_regular_file(error)) continue;
        try {
            if (record::hdf5_format(entry->path().string()) == "ringlock-result") files.push_back(entry->path());
        } catch (const InputError&) {
            continue;  // another kind of file
        }
    }
    std::sort(files.begin(), files.end());
    return files;
}

report::Page page_of_folder(const fs::path& folder) {
    std::error_code unknown;
    if (fs::exists(folder / "closure.json", unknown)) return closed_loop_page(folder);
    if (fs::exists(folder / "batch.json", unknown)) return batch_page(folder);
    const std::vector<fs::path> files = results_in(folder);
    if (files.empty()) {
        throw InputError(fmt::format("{}: holds neither closure.json nor batch.json nor a result of ringlock run; {}",
                                     printable(folder), inputs_allowed));
    }
    return results_page(files, named(folder).filename().string());
}

report::Page page_of_file(const fs::path& file) {
    std::error_code unknown;
    if (!fs::exists(file, unknown)) {
        throw InputError(fmt::format("{}: there is no such file; {}", printable(file), inputs_allowed));
    }
    if (!record::is_hdf5(file.string())) {
        if (file.extension() != ".h5" && file.extension() != ".hdf5") return page_of_json(file);
        return study_page(file);  // whose message says in what way it is damaged
    }
    const std::string format = record::hdf5_format(file.string());
    if (format == "ringlock-result") return study_page(file);
    if (format == "rlg-closure") return closed_loop_page(file.parent_path());
    throw InputError(fmt::format(
        "{}: attribute format is \"{}\"; {}. A record is read by ringlock closure RECORD -o DIR, or by ringlock allan",
        printable(file), printable(format), inputs_allowed));
}

void report_on(const ReportArguments& arguments) {
    const fs::path target = page_of(arguments);
    std::vector<NamedFile> files{{"-o", target, NamedFile::Use::output}};
    for (const std::string& input : arguments.inputs) files.push_back({"input", input, NamedFile::Use::input});
    refuse_same_files(files);
    refuse_to_lose_other(target);
    AtomicPath claimed(target);
    const report::Page page = [&] {
        std::error_code unknown;
        if (arguments.inputs.size() > 1) {
            return results_page({arguments.inputs.begin(), arguments.inputs.end()},
                                fmt::format("{} studies", arguments.inputs.size()));
        }
        const fs::path input = arguments.inputs.front();
        return fs::is_directory(input, unknown) ? page_of_folder(input) : page_of_file(input);
    }();
    const std::string html = page.html();
    write_text(claimed, html);
    const std::string script = report::page_script();
    put(fmt::format(
        "{}: {:.0f} kB, {}\n", printable(target), static_cast<double>(html.size()) * 1e-3,
        script == "none" ? "drawn figures only (this build has no dygraphs)" : "figures interactive by " + script));
}

}  // namespace

void add_report(CLI::App& root) {
    CLI::App* command =
        root.add_subcommand("report", "One HTML page of a result, a batch, a closed loop or an analysis");
    auto arguments = std::make_shared<ReportArguments>();
    command
        ->add_option("INPUT", arguments->inputs,
                     "result of ringlock run, or several; folder of ringlock closure -o or of a batch; file with the "
                     "output of ringlock allan --json")
        ->required();
    command->add_option("-o,--output", arguments->out,
                        "the page (.html); otherwise it is next to the input and ends in .report.html");
    command->callback([arguments] {
        name_file_of_failure(fmt::format("{}", fmt::join(arguments->inputs, ", ")), [&] { report_on(*arguments); });
    });
}

}  // namespace ringlock::app
