#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "analysis/record/probe.hpp"
#include "analysis/record/record.hpp"
#include "analysis/study/result/result_file.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/output.hpp"
#include "app/record_output.hpp"
#include "engine/core/error.hpp"

namespace ringlock::app {
namespace {

void validate_record(const std::string& path) {
    const record::Record record = record::read_record(path);
    tell_warnings(path, record);
    const bool to_close = record.turns ? record.turns->size() >= record::fewest_turns_to_close
                                       : record.samples->size() >= record::fewest_samples_to_close;
    const std::string too_short = fmt::format("; too short for `ringlock closure`, which needs {} turns, or {} samples",
                                              record::fewest_turns_to_close, record::fewest_samples_to_close);
    put(fmt::format("{}: a valid record: {}{}\n", path, record_text(record), to_close ? "" : too_short));
}

void validate(const std::string& path, const Changes& changes) {
    const std::filesystem::path extension = std::filesystem::path(path).extension();
    if (!changes.settings.empty() && extension != ".toml") {
        throw InputError(fmt::format("--set: {} is no scenario (.toml), and only keys of these can be set", path));
    }
    if (record::is_hdf5(path) || extension == ".h5" || extension == ".hdf5") {
        const std::string format = record::hdf5_format(path);
        if (format == "rlg-record") return validate_record(path);
        if (format == "ringlock-result") {
            record::try_reading(path, [&] { study::read_result(path); });
            const study::Experiment experiment = study::read_result(path);
            const std::string points =
                experiment.has_design() ? fmt::format("{} points, ", experiment.points.size()) : "";
            return put(fmt::format("{}: a valid result of {}{} gyros and {} arms\n", path, points, experiment.gyros(),
                                   experiment.scenario.arms.size()));
        }
        throw InputError(
            fmt::format("{}: /: attribute format is \"{}\"; it says what the file is and must be "
                        "\"ringlock-result\" or \"rlg-record\"",
                        path, format));
    }
    if (extension == ".toml") {
        load_scenario(path, changes);
        return put(fmt::format("{}: a valid scenario\n", path));
    }
    if (extension == ".csv") return validate_record(path);
    try {
        validate_record(path);
    } catch (const InputError& error) {
        throw InputError(
            fmt::format("{}\n{}: was taken for a record in the text form; scenarios end in .toml", error.what(), path));
    }
}

}  // namespace

void add_validate(CLI::App& root) {
    CLI::App* command = root.add_subcommand("validate", "Say what is wrong in a scenario, record or result, and where");
    struct Arguments {
        std::string file;
        Changes changes;
    };
    auto arguments = std::make_shared<Arguments>();
    command->add_option("FILE", arguments->file, "scenario (.toml), record (HDF5 or text) or result")->required();
    add_settings(*command, arguments->changes);
    command->callback([arguments] { validate(arguments->file, arguments->changes); });
}

}  // namespace ringlock::app
