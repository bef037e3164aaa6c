#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <string>

#include "app/command.hpp"
#include "engine/core/error.hpp"

namespace ringlock::app {

void add_planned(CLI::App& root) {
    // Their names are reserved, but the help shows only commands that can be used.
    constexpr std::array planned = {"report"};
    for (const char* const name : planned) {
        CLI::App* command = root.add_subcommand(name)->group("");
        command->allow_extras();
        const std::string text = name;
        command->callback([text] {
            throw InputError(
                fmt::format("the command \"{}\" is not available yet; the commands are run, merge, status, submit, "
                            "analyze, allan, validate, import, record, replay, devices and closure",
                            text));
        });
    }
}

}  // namespace ringlock::app
