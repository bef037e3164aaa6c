#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "app/command.hpp"
#include "app/output.hpp"
#include "app/terminal/command_line.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/version.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/keys/schema.hpp"

/// Manual pages in the macros of man(7).
namespace ringlock::app {
namespace {

/// A text in which troff takes nothing for its own.
std::string troff(std::string_view text) {
    std::string out;
    bool begins_line = true;
    for (const char c : text) {
        if (begins_line && (c == '.' || c == '\'')) out += "\\&";
        switch (c) {
            case '\\':
                out += "\\e";
                break;
            case '-':
                out += "\\-";
                break;
            case '\'':
                out += "\\(aq";
                break;
            case '`':
                out += "\\(ga";
                break;
            case '^':
                out += "\\(ha";
                break;
            case '~':
                out += "\\(ti";
                break;
            default:
                out += c;
        }
        begins_line = c == '\n';
    }
    return out;
}

/// Prose in lines, each sentence on a line of its own, as troff has it.
std::string prose(std::string_view text) {
    std::string lines;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const bool ends_sentence = (text[i] == '.' || text[i] == '?') && i + 2 < text.size() && text[i + 1] == ' ' &&
                                   std::isupper(static_cast<unsigned char>(text[i + 2])) != 0;
        lines += text[i];
        if (ends_sentence) {
            lines += '\n';
            ++i;
        }
    }
    return troff(lines) + "\n";
}

/// A text as sentences: it begins with a capital, unless with a word that is written otherwise, and ends with a full
/// stop.
std::string sentences(std::string text) {
    const std::string first = text.substr(0, text.find_first_of(" ,;:"));
    const bool is_word = std::all_of(first.begin(), first.end(), [](unsigned char c) { return std::islower(c) != 0; });
    if (is_word && !text.empty()) text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
    if (!text.ends_with('.')) text += '.';
    return prose(text);
}

std::string bold(std::string_view text) { return fmt::format("\\fB{}\\fR", troff(text)); }
std::string italic(std::string_view text) { return fmt::format("\\fI{}\\fR", troff(text)); }

std::string capitals(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::toupper(c); });
    return text;
}

std::string page_head(const std::string& name, int section, std::string_view manual) {
    return fmt::format(".\\\" Made by `ringlock man`.\n.TH {} {} {} \"ringlock {}\" \"{}\"\n.nh\n.ad l\n",
                       troff(capitals(name)), section, commit_date().empty() ? "1970-01-01" : commit_date(), version(),
                       manual);
}

std::string first_small(std::string text) {
    if (text.size() > 1 && std::islower(static_cast<unsigned char>(text[1])) != 0) {
        text[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(text[0])));
    }
    return text;
}

std::string value_of_option(const ArgumentInfo& argument) {
    if (argument.is_positional) return "";
    if (argument.is_flag) return argument.values.words.empty() ? "" : "[=" + italic(argument.values.placeholder) + "]";
    return " " + italic(argument.values.placeholder);
}

std::string synopsis(const CommandInfo& command) {
    std::string out = ".SH SYNOPSIS\n.B ringlock " + troff(command.name) + "\n";
    for (const ArgumentInfo& argument : command.arguments) {
        if (argument.names.empty() || argument.names.back() == "--help") continue;
        std::string text = argument.is_positional ? italic(argument.names.front()) : bold(argument.names.front());
        text += value_of_option(argument);
        if (!argument.is_required) text = "[" + text + "]";
        if (argument.repeats) text += "\\ ...\\&";
        out += text + "\n";
    }
    return out;
}

std::string arguments_text(const CommandInfo& command) {
    std::string out;
    for (const ArgumentInfo& argument : command.arguments) {
        std::string names;
        for (const std::string& name : argument.names) {
            names += names.empty() ? "" : ", ";
            names += argument.is_positional ? italic(name) : bold(name);
        }
        out += ".TP\n" + names + value_of_option(argument) + "\n" + sentences(argument.meaning);
        if (!argument.fallback.empty()) out += fmt::format("Default: {}.\n", troff(argument.fallback));
    }
    return out;
}

std::string exit_status() {
    return ".SH EXIT STATUS\n"
           ".TP\n.B 0\nDone.\n"
           ".TP\n.B 1\nThe run failed: disk, memory, a trajectory that could not be finished.\n"
           ".TP\n.B 2\nThe input or the command line is wrong.\n"
           ".PP\nA command that is interrupted ends by the signal itself.\n";
}

std::string examples_text(const std::string& command) {
    std::string out;
    for (const Example& example : examples_of(command)) {
        std::string meaning(example.meaning);
        meaning[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(meaning[0])));
        out += fmt::format("{}{}:\n.PP\n.in +4n\n.nf\n{}\n.fi\n.in\n", out.empty() ? "" : ".PP\n", troff(meaning),
                           troff(example.command_line));
    }
    return out.empty() ? "" : ".SH EXAMPLES\n" + out;
}

std::string command_page(const CommandInfo& command) {
    const std::string name = "ringlock-" + command.name;
    std::string out = page_head(name, 1, "ringlock manual");
    out += fmt::format(".SH NAME\n{} \\- {}\n", troff(name), troff(first_small(command.meaning)));
    out += synopsis(command);
    out += ".SH OPTIONS\n" + arguments_text(command);
    out += exit_status() + examples_text(command.name);
    return out + ".SH SEE ALSO\n.BR ringlock (1),\n.BR ringlock\\-scenario (5)\n";
}

std::string program_page(const std::vector<CommandInfo>& commands) {
    std::string out = page_head("ringlock", 1, "ringlock manual");
    out +=
        ".SH NAME\nringlock \\- simulation and analysis of the lock\\-in of dithered ring laser gyros\n"
        ".SH SYNOPSIS\n.B ringlock\n.I COMMAND\n[\\fIARGUMENT\\fR\\ ...]\n.br\n.B ringlock\n.I COMMAND\n"
        ".B \\-\\-help\n.br\n.B ringlock \\-\\-version\n.SH DESCRIPTION\n";
    std::string description = commands.front().meaning;
    description.erase(0, description.find('\n') + 1);
    std::replace(description.begin(), description.end(), '\n', ' ');
    out += prose(description) + ".PP\nEach command has a page of its own.\n.SH COMMANDS\n";
    for (const CommandInfo& command : commands) {
        if (command.name.empty()) continue;
        out += fmt::format(".TP\n.BR ringlock\\-{} (1)\n{}", troff(command.name), sentences(command.meaning));
    }
    out += ".SH OPTIONS\n" + arguments_text(commands.front());
    out += exit_status();
    out +=
        ".SH ENVIRONMENT\n.TP\n.B NO_COLOR\nIf it is set and not empty, errors have no colour on a terminal.\n"
        ".TP\n.B TMPDIR\nFolder of temporary files.\n";
    out +=
        ".SH EXAMPLES\nA study from nothing:\n.PP\n.in +4n\n.nf\n"
        "ringlock new \\-o first.toml\n"
        "ringlock run first.toml \\-o first.h5\n"
        "ringlock analyze first.h5 \\-\\-plot first.svg\n.fi\n.in\n";
    out += ".SH SEE ALSO\n";
    for (const CommandInfo& command : commands) {
        if (!command.name.empty()) out += fmt::format(".BR ringlock\\-{} (1),\n", troff(command.name));
    }
    return out + ".BR ringlock\\-scenario (5)\n";
}

std::string scenario_page() {
    std::string out = page_head("ringlock-scenario", 5, "ringlock manual");
    out +=
        ".SH NAME\nringlock\\-scenario \\- keys of a scenario of ringlock\n.SH DESCRIPTION\n"
        "A scenario is a TOML file that\n.BR ringlock\\-run (1)\nsimulates.\n"
        "A key that is not named has its default, so that an empty file is valid.\n"
        "Every key carries its unit in its name.\n"
        ".PP\n\\fBdevice\\fR = \"NAME\" before all sections takes the constants of a known gyro for defaults;\n"
        ".BR ringlock\\-devices (1)\nlists them.\n"
        ".BR ringlock\\-new (1)\nwrites a commented scenario to begin with.\n";
    for (const scenario::Section& section : scenario::schema()) {
        const char* brackets[2] = {section.elements ? "[[" : "[", section.elements ? "]]" : "]"};
        out += fmt::format(".SH {}{}{}\n{}", brackets[0], troff(section.name), brackets[1], prose(section.doc));
        for (const scenario::Key& key : section.keys) {
            const std::string_view unit = scenario::unit_of(key.name);
            const bool has_unit = unit != "1" && key.type != scenario::Type::word && key.type != scenario::Type::text;
            std::string allowed = scenario::allowed_text(key);
            allowed[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(allowed[0])));
            if (!key.bounds.why.empty()) allowed += ": " + key.bounds.why;
            out += fmt::format(".TP\n{} = {}{}\n{}{}", bold(key.name), troff(scenario::to_toml(key.default_value())),
                               has_unit ? fmt::format(" [{}]", troff(unit)) : "", prose(key.doc), prose(allowed + "."));
        }
    }
    out += ".SH RULES BETWEEN KEYS\n";
    for (const std::string_view rule : scenario::rules()) out += ".IP \\(bu 2\n" + prose(rule);
    return out + ".SH SEE ALSO\n.BR ringlock (1),\n.BR ringlock\\-run (1),\n.BR ringlock\\-validate (1)\n";
}

void write_pages(const std::filesystem::path& folder, const std::vector<CommandInfo>& commands) {
    for (const char* section : {"man1", "man5"}) {
        std::error_code failed;
        std::filesystem::create_directories(folder / section, failed);
        if (failed) {
            throw InputError(fmt::format("--all {}: the folder {} cannot be made ({}); give another folder",
                                         printable(folder), section, failed.message()));
        }
    }
    write_text(folder / "man5" / "ringlock-scenario.5", scenario_page());
    for (const CommandInfo& info : commands) {
        if (info.name.empty()) {
            write_text(folder / "man1" / "ringlock.1", program_page(commands));
        } else {
            write_text(folder / "man1" / fmt::format("ringlock-{}.1", info.name), command_page(info));
        }
    }
}

}  // namespace

void add_man(CLI::App& root) {
    CLI::App* command = root.add_subcommand("man", "Print a manual page: of the program, a command or scenarios");
    const auto page = std::make_shared<std::string>();
    const auto folder = std::make_shared<std::string>();
    CLI::Option* name = command->add_option(
        "COMMAND", *page, "the command, or scenario for the keys of scenarios (default: the program)");
    command->add_option("--all", *folder, "write all pages into man1 and man5 of this folder, for packages")
        ->excludes(name);
    command->callback([page, folder, &root] {
        const std::vector<CommandInfo> commands = commands_of(root);
        if (!folder->empty()) return write_pages(*folder, commands);
        if (page->empty()) return put(program_page(commands));
        if (*page == "scenario") return put(scenario_page());
        std::string known;
        for (const CommandInfo& info : commands) {
            if (info.name == *page) return put(command_page(info));
            known += info.name.empty() ? "" : info.name + ", ";
        }
        throw InputError(
            fmt::format("{}: has no manual page; there are pages of {}scenario, and, without a name, of "
                        "the program",
                        printable(*page), known));
    });
}

}  // namespace ringlock::app
