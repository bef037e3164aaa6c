#include "analysis/parts/status.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "analysis/parts/folder.hpp"
#include "analysis/parts/part_files.hpp"
#include "analysis/parts/shard.hpp"
#include "analysis/record/record.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/output.hpp"
#include "app/run/run_text.hpp"
#include "engine/core/error.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {

namespace {

namespace fs = std::filesystem;

struct StatusArguments {
    std::string out;
    bool json = false;
};

/// One output: the whole run, or a shard of it.
struct StatusLine {
    std::string name;
    std::string state;  ///< "finished", "running", "interrupted"
    std::string holder;
    std::int64_t gyros = 0;
    std::optional<std::int64_t> of_gyros;
    std::optional<parts::Status> status;  ///< as the process wrote it last
};

/// Gyros that are kept in the folder of an interrupted run; a damaged file counts no gyros.
std::int64_t gyros_in(const fs::path& folder) {
    std::optional<parts::FinishedGyros> finished;
    for (const fs::path& file : parts::part_files(folder)) {
        try {
            if (!finished) finished.emplace(parts::read_manifest(file));
            finished->add_file(file);
        } catch (const InputError& damage) {
            tell(fmt::format("ringlock: {}\n", damage.what()));
        }
    }
    return finished ? finished->gyros() : 0;
}

std::optional<StatusLine> line_of(const fs::path& output, const std::string& name) {
    const fs::path folder = parts::folder_of(output);
    std::error_code unknown;
    StatusLine line{name, "", "", 0, {}, parts::read_status(folder)};
    if (line.status) line.of_gyros = line.status->of_gyros;
    line.holder = parts::holder(folder);
    if (!line.holder.empty()) {
        line.state = "running";
        if (line.status) line.gyros = line.status->gyros;
    } else if (fs::exists(output, unknown)) {
        line.state = "finished";
        if (store::is_part(output)) {
            parts::FinishedGyros finished(parts::read_manifest(output));
            finished.add_file(output);
            line.gyros = finished.gyros();
            line.of_gyros = line.gyros;
        } else if (!record::is_hdf5(output) || record::hdf5_format(output) != "ringlock-result") {
            throw InputError(
                fmt::format("{}: the file is neither a result nor a shard of ringlock run, so that there is no run to "
                            "report; give the name that ringlock run has with -o",
                            printable(output)));
        }
    } else if (fs::is_directory(folder, unknown)) {
        line.state = "interrupted";
        line.gyros = gyros_in(folder);
    } else {
        return std::nullopt;
    }
    return line;
}

std::vector<StatusLine> lines_of(const fs::path& out) {
    std::vector<StatusLine> lines;
    const auto add = [&](const fs::path& output, const std::string& name) {
        if (auto line = line_of(output, name)) lines.push_back(*line);
    };
    add(out, out.string());
    for (const parts::Shard& shard : parts::shards_begun(out)) {
        add(parts::shard_file(out, shard), "shard " + parts::to_string(shard));
    }
    if (lines.empty()) {
        throw InputError(
            fmt::format("{}: there is no result of that name, no run that writes it and no shard of it; "
                        "give the name that ringlock run has with -o",
                        printable(out)));
    }
    return lines;
}

std::string text_of(const StatusLine& line) {
    std::string text = fmt::format("{}: {}", printable(line.name), line.state);
    if (!line.holder.empty()) text += fmt::format(" by {}", printable(line.holder));
    if (line.of_gyros) {
        text += fmt::format(", {} of {}", line.gyros, gyros_text(*line.of_gyros));
    } else if (line.gyros > 0) {
        text += fmt::format(", {} kept", gyros_text(line.gyros));
    }
    if (line.state == "running" && line.status) {
        text += fmt::format(", {:.3g} turns/s", line.status->turns_per_s);
        text += line.status->left_s ? fmt::format(", {} left", duration_text(*line.status->left_s)) : "";
    }
    if (line.state != "finished" && line.status && !line.status->last_block.empty()) {
        text += fmt::format("; last block: {}", printable(line.status->last_block));
    }
    if (line.state == "interrupted") text += "; run --resume goes on";
    return text + "\n";
}

nlohmann::ordered_json json_of(const StatusLine& line) {
    nlohmann::ordered_json json{{"name", line.name},   {"state", line.state},  {"process", nullptr},
                                {"gyros", line.gyros}, {"of_gyros", nullptr},  {"turns_per_s", nullptr},
                                {"left_s", nullptr},   {"last_block", nullptr}};
    if (!line.holder.empty()) json["process"] = line.holder;
    if (line.of_gyros) json["of_gyros"] = *line.of_gyros;
    if (line.state == "running" && line.status) {
        json["turns_per_s"] = line.status->turns_per_s;
        if (line.status->left_s) json["left_s"] = *line.status->left_s;
    }
    if (line.status && !line.status->last_block.empty()) json["last_block"] = line.status->last_block;
    return json;
}

void tell_status(const StatusArguments& arguments) {
    const std::vector<StatusLine> lines = lines_of(arguments.out);
    if (!arguments.json) {
        for (const StatusLine& line : lines) put(text_of(line));
        return;
    }
    auto outputs = nlohmann::ordered_json::array();
    for (const StatusLine& line : lines) outputs.push_back(json_of(line));
    put(json_text(nlohmann::ordered_json{{"outputs", outputs}}) + "\n");
}

}  // namespace

void add_status(CLI::App& root) {
    CLI::App* command = root.add_subcommand("status",
                                            "Show the progress of a run, of its shards or of an interrupted run, "
                                            "from any terminal");
    auto arguments = std::make_shared<StatusArguments>();
    command->add_option("OUT.h5", arguments->out, "the result that is, or will be, written")->required();
    command->add_flag("--json", arguments->json, "print one JSON object instead of lines");
    command->callback([arguments] { name_file_of_failure(arguments->out, [&] { tell_status(*arguments); }); });
}

}  // namespace ringlock::app
