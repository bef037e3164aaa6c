#include "app/terminal/command_line.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>

namespace ringlock::app {
namespace {

ArgumentInfo info_of(const std::string& command, const CLI::Option& option) {
    ArgumentInfo info;
    info.is_positional = option.get_positional();
    info.is_flag = option.get_items_expected_max() == 0;
    info.is_required = option.get_required();
    info.repeats = option.get_expected_max() >= CLI::detail::expected_max_vector_size;
    info.fallback = info.is_flag ? "" : option.get_default_str();
    info.meaning = option.get_description();
    if (info.is_positional) {
        info.names = {option.get_name(true, false)};
        info.values = values_of(command, info.names.front());
        return info;
    }
    for (const std::string& name : option.get_snames()) info.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) info.names.push_back("--" + name);
    // A flag with several forms, as --print-schema{toml}, takes its value behind "=" alone.
    info.values = info.names.empty() ? Values{} : values_of(command, info.names.back());
    if (info.values.placeholder.empty()) info.values.placeholder = info.is_flag ? "" : option.get_type_name();
    return info;
}

CommandInfo info_of(const CLI::App& command, const std::string& name) {
    CommandInfo info{name, command.get_description(), {}, command.get_footer()};
    for (const CLI::Option* option : command.get_options()) {
        if (option->get_group().empty()) continue;
        info.arguments.push_back(info_of(name, *option));
    }
    // Positional arguments first, as they stand in a synopsis.
    std::stable_partition(info.arguments.begin(), info.arguments.end(),
                          [](const ArgumentInfo& argument) { return argument.is_positional; });
    return info;
}

}  // namespace

std::vector<CommandInfo> commands_of(const CLI::App& root) {
    std::vector<CommandInfo> out = {info_of(root, "")};
    for (const CLI::App* command : root.get_subcommands({})) {
        if (!command->get_group().empty()) out.push_back(info_of(*command, command->get_name()));
    }
    return out;
}

}  // namespace ringlock::app
