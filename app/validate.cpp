#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "analysis/study/result_file.hpp"
#include "app/command.hpp"
#include "app/output.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/parse.hpp"

namespace ringlock::app {

void add_validate(CLI::App& root) {
    CLI::App* command = root.add_subcommand("validate", "Say what is wrong in a scenario or result, and where");
    auto file = std::make_shared<std::string>();
    command->add_option("FILE", *file, "scenario (.toml) or result (.h5)")->required();
    command->callback([file] {
        const std::filesystem::path path = *file;
        if (path.extension() == ".toml") {
            scenario::parse_file(path);
            put(fmt::format("{}: a valid scenario\n", *file));
        } else if (path.extension() == ".h5" || path.extension() == ".hdf5") {
            const study::Study study = study::read_result(path);
            put(fmt::format("{}: a valid result of {} gyros and {} arms\n", *file, study.gyros.size(),
                            study.arms.size()));
        } else {
            throw InputError(
                fmt::format("{}: \"{}\" is no extension that validate knows; scenarios end in .toml, results "
                            "in .h5 (records are not there yet)",
                            *file, path.extension().string()));
        }
    });
}

}  // namespace ringlock::app
