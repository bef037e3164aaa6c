#pragma once
#include <CLI/App.hpp>
#include <string>
#include <string_view>
#include <vector>

/// The program's own options, for its help, its manual pages and the completion in shells.
namespace ringlock::app {

/// The values that an option can have.
struct Values {
    enum class Kind {
        any,      ///< anything, of which nothing is known beforehand
        words,    ///< one of `words`, which may not be all that is allowed
        file,     ///< a file, with one of the endings `words` if there are any
        folder,   ///< a folder
        setting,  ///< SECTION.KEY=VALUE of a scenario
        device,   ///< a name of a gyro that a scenario can name
        command,  ///< a command of this program
    };
    std::string placeholder;  ///< for help, "FILE"
    Kind kind = Kind::any;
    std::vector<std::string> words = {};
};

/// Values of an option ("--kind") or positional argument ("DATA") of a command; with the placeholder empty where the
/// table has no entry.
Values values_of(const std::string& command, const std::string& argument);

/// An option or positional argument.
struct ArgumentInfo {
    std::vector<std::string> names;  ///< "-o", "--output"; of a positional one its placeholder
    bool is_positional = false;
    bool is_flag = false;
    bool is_required = false;
    bool repeats = false;
    std::string fallback;  ///< default value, if it is shown
    std::string meaning;
    Values values;
};

struct CommandInfo {
    std::string name;  ///< empty for the program itself
    std::string meaning;
    std::vector<ArgumentInfo> arguments;
    std::string footer;
};

/// The program, then its commands in the order of the help; hidden ones are left out.
std::vector<CommandInfo> commands_of(const CLI::App& root);

/// Gives options a placeholder in place of their type, wraps the help to 100 columns, and adds examples to each command
/// that has none. Call it when all commands are there.
void finish_help(CLI::App& root);

/// A command of the examples, and its effect.
struct Example {
    std::string_view command_line;
    std::string_view meaning;
};
/// Examples of a command; none for one that the table does not know.
std::vector<Example> examples_of(const std::string& command);

}  // namespace ringlock::app
