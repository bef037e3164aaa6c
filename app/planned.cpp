#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <utility>

#include "app/command.hpp"
#include "engine/core/error.hpp"

namespace ringlock::app {

void add_planned(CLI::App& root) {
    constexpr std::array<std::pair<const char*, const char*>, 3> planned = {{
        {"merge", "Join the shards of one run (not there yet)"},
        {"replay", "Simulate one gyro of a result again, at full detail (not there yet)"},
        {"report", "Write a report of a result (not there yet)"},
    }};
    for (const auto& [name, what] : planned) {
        CLI::App* command = root.add_subcommand(name, what);
        command->allow_extras();
        const std::string text = name;
        command->callback([text] {
            throw InputError(
                fmt::format("the command \"{}\" is not there yet; there are run, analyze, allan, validate, import, "
                            "record and closure",
                            text));
        });
    }
}

}  // namespace ringlock::app
