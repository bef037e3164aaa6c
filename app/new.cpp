#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/command.hpp"
#include "app/output.hpp"
#include "app/starter.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/scenario/devices.hpp"
#include "engine/scenario/text/text.hpp"

namespace ringlock::app {
namespace {

struct NewArguments {
    std::string device, out;
};

std::optional<scenario::NamedDevice> device_named(const std::string& name) {
    if (name.empty()) return std::nullopt;
    if (const scenario::DeviceFile* file = scenario::find_device(name)) return scenario::read_device(*file);
    std::vector<std::string> known;
    for (const scenario::DeviceFile& file : scenario::device_files()) known.emplace_back(file.name);
    throw InputError(fmt::format("{}: is not a known device{}; there are {}. ringlock devices lists their constants",
                                 printable(name), scenario::did_you_mean(name, known), fmt::join(known, ", ")));
}

void write_starter(const NewArguments& a) {
    const std::optional<scenario::NamedDevice> device = device_named(a.device);
    const std::string text = starter_text(device ? &*device : nullptr);
    if (a.out.empty()) return put(text);
    if (std::filesystem::path(a.out).extension() != ".toml") {
        throw InputError(fmt::format("-o {}: a scenario's name must end in .toml", printable(a.out)));
    }
    if (std::error_code error; std::filesystem::exists(std::filesystem::symlink_status(a.out, error))) {
        throw InputError(
            fmt::format("-o {}: is there already and is kept, for it may be a scenario that somebody has written; "
                        "give another name",
                        printable(a.out)));
    }
    write_text(a.out, text);
}

}  // namespace

void add_new(CLI::App& root) {
    CLI::App* command = root.add_subcommand("new", "Write a commented scenario to begin with, which runs as it is");
    const auto arguments = std::make_shared<NewArguments>();
    command->add_option("DEVICE", arguments->device,
                        "gyro whose constants it has, as ringlock devices lists them (default: that of Gao & Deng "
                        "2007)");
    command->add_option("-o,--output", arguments->out, "scenario to write (.toml); default: standard output");
    command->callback([arguments] { write_starter(*arguments); });
}

}  // namespace ringlock::app
