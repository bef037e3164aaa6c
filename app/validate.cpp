#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>

#include "analysis/parts/manifest.hpp"
#include "analysis/parts/part_files.hpp"
#include "analysis/record/container.hpp"
#include "analysis/record/record.hpp"
#include "analysis/study/result/result_file.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/output.hpp"
#include "app/record/record_output.hpp"
#include "app/run/run_text.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/store/part_file.hpp"

namespace ringlock::app {
namespace {

void validate_record(const std::string& path, store::Links links = store::Links::refuse) {
    const record::Record record = record::read_record(path, links);
    tell_warnings(path, record);
    const bool to_close = record.turns ? record.turns->size() >= record::fewest_turns_to_close
                                       : record.samples->size() >= record::fewest_samples_to_close;
    const std::string too_short = fmt::format("; too short for `ringlock closure`, which needs {} turns, or {} samples",
                                              record::fewest_turns_to_close, record::fewest_samples_to_close);
    put(fmt::format("{}: a valid record: {}{}\n", printable(path), record_text(record), to_close ? "" : too_short));
}

/// A shard, or finished gyros that an interrupted run has kept: each record passes its checksum, and each block fits.
void validate_part(const std::string& path) {
    const parts::Manifest of = parts::read_manifest(path);
    parts::FinishedGyros finished(of);
    finished.add_file(path);
    study::Experiment plan(of.scenario);
    if (scenario::asks(of.scenario.stop)) {
        for (study::Study& point : plan.points) study::extend(point, of.scenario.stop.most_gyros);
    }
    finished.take_up(plan.points, 0, std::numeric_limits<std::int64_t>::max());
    const std::string what = of.shard ? fmt::format("shard {}", parts::to_string(*of.shard)) : "checkpoint";
    put(fmt::format("{}: a valid {}: {} of a run by ringlock {} ({})\n", printable(path), what,
                    gyros_text(finished.gyros()), printable(of.program_version), printable(of.git_hash)));
}

void validate(const std::string& path, const Changes& changes, store::Links links) {
    const std::filesystem::path extension = std::filesystem::path(path).extension();
    if (!changes.settings.empty() && extension != ".toml") {
        throw InputError(
            fmt::format("--set: {} is not a scenario (.toml); only keys of scenarios can be set", printable(path)));
    }
    if (store::is_part(path)) return validate_part(path);
    if (record::is_hdf5(path) || extension == ".h5" || extension == ".hdf5") {
        const std::string format = record::hdf5_format(path, links);
        if (format == "rlg-record") return validate_record(path, links);
        if (format == "ringlock-result") {
            const study::Experiment experiment = study::read_result(path);
            const std::string points =
                experiment.has_design() ? fmt::format("{} points, ", experiment.points.size()) : "";
            return put(fmt::format("{}: a valid result of {}{} gyros and {} arms\n", printable(path), points,
                                   experiment.gyros(), experiment.scenario.arms.size()));
        }
        throw InputError(
            fmt::format("{}: /: attribute format is \"{}\"; it names the kind of file and must be \"ringlock-result\" "
                        "or \"rlg-record\"",
                        printable(path), printable(format)));
    }
    if (extension == ".toml") {
        load_scenario(path, changes);
        return put(fmt::format("{}: a valid scenario\n", printable(path)));
    }
    if (const auto container = record::container_of(path); container != record::Container::text) {
        throw InputError(
            fmt::format("{}: is {}, which is not a record: convert it with ringlock import --column NAME=QUANTITY, "
                        "or read it with ringlock allan",
                        printable(path), record::name_of(container)));
    }
    if (extension == ".csv") return validate_record(path);
    try {
        validate_record(path);
    } catch (const InputError& error) {
        throw InputError(fmt::format("{}\n{}: was taken for a record in the text form; scenarios end in .toml",
                                     error.what(), printable(path)));
    }
}

}  // namespace

void add_validate(CLI::App& root) {
    CLI::App* command =
        root.add_subcommand("validate", "Check a scenario, record, result or shard, and name each error and its place");
    struct Arguments {
        std::string file;
        Changes changes;
        bool follow_links = false;
    };
    auto arguments = std::make_shared<Arguments>();
    command->add_option("FILE", arguments->file, "scenario (.toml), record (HDF5 or text), result, shard or checkpoint")
        ->required();
    add_settings(*command, arguments->changes);
    add_follow_links(*command, arguments->follow_links);
    command->callback([arguments] {
        name_file_of_failure(arguments->file, [&] {
            validate(arguments->file, arguments->changes,
                     arguments->follow_links ? store::Links::follow : store::Links::refuse);
        });
    });
}

}  // namespace ringlock::app
