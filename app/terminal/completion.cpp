#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "app/command.hpp"
#include "app/output.hpp"
#include "app/terminal/command_line.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/scenario/devices.hpp"
#include "engine/scenario/keys/schema.hpp"

namespace ringlock::app {
namespace {

using Kind = Values::Kind;

/// A key of a scenario that --set takes, with the words that it can have; no words where it is a number or a list.
struct SettingKey {
    std::string path;
    std::vector<std::string> words;
};

std::vector<std::string> device_names() {
    std::vector<std::string> out;
    for (const scenario::DeviceFile& file : scenario::device_files()) out.emplace_back(file.name);
    return out;
}

std::vector<SettingKey> setting_keys() {
    std::vector<SettingKey> out = {{"device", device_names()}};
    for (const scenario::Section& section : scenario::schema()) {
        if (section.elements) continue;
        for (const scenario::Key& key : section.keys) {
            out.push_back({key.path(), key.type == scenario::Type::boolean ? std::vector<std::string>{"true", "false"}
                                                                           : key.words});
        }
    }
    return out;
}

std::string joined(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, " ")); }

/// Words of an option with the names of other things put in.
std::vector<std::string> words_of(const Values& values, const std::vector<CommandInfo>& commands) {
    if (values.kind == Kind::device) return device_names();
    std::vector<std::string> out;
    if (values.kind == Kind::command) {
        for (const CommandInfo& command : commands) {
            if (!command.name.empty()) out.push_back(command.name);
        }
    }
    out.insert(out.end(), values.words.begin(), values.words.end());
    return out;
}

/// First sentence of a text, for lists that have one line for each entry.
std::string short_meaning(const std::string& text) {
    std::string out = text.substr(0, std::min({text.find(';'), text.find(". "), text.find('\n'), text.size()}));
    if (out.ends_with('.')) out.pop_back();
    constexpr std::size_t most = 70;
    if (out.size() > most) out = out.substr(0, out.find_last_of(' ', most)) + " ...";
    return out;
}

/// A text in single quotes of a shell.
std::string single_quoted(const std::string& text) {
    std::string out = "'";
    for (const char c : text) {
        if (c == '\'') {
            out += "'\\''";
        } else {
            out += c;
        }
    }
    return out + "'";
}

bool takes_value(const ArgumentInfo& argument) { return !argument.is_flag && !argument.is_positional; }

// bash

std::string bash_action(const Values& values, const std::vector<CommandInfo>& commands) {
    switch (values.kind) {
        case Kind::words:
        case Kind::device:
        case Kind::command:
            return fmt::format("_ringlock_words '{}'", joined(words_of(values, commands)));
        case Kind::file:
            return fmt::format("_ringlock_files{}{}", values.words.empty() ? "" : " ", joined(values.words));
        case Kind::folder:
            return "_ringlock_folders";
        case Kind::setting:
            return "_ringlock_setting";
        case Kind::any:
            break;
    }
    return ":";
}

std::string bash_completion(const std::vector<CommandInfo>& commands) {
    std::string names;
    std::string values;
    std::string options;
    std::string operands;
    for (const CommandInfo& command : commands) {
        if (!command.name.empty()) names += (names.empty() ? "" : " ") + command.name;
        std::string own;
        std::vector<const ArgumentInfo*> positional;
        for (const ArgumentInfo& argument : command.arguments) {
            if (argument.is_positional) positional.push_back(&argument);
            if (argument.is_positional) continue;
            for (const std::string& name : argument.names) own += (own.empty() ? "" : " ") + name;
            const bool has_form = argument.is_flag && !argument.values.words.empty();
            if (!takes_value(argument) && !has_form) continue;
            std::string patterns;
            for (const std::string& name : argument.names) {
                for (const char* form : {"", "="}) {
                    if (has_form && *form == '\0') continue;
                    patterns += fmt::format("{}'{} {}{}'", patterns.empty() ? "" : " | ", command.name, name, form);
                }
            }
            values += fmt::format("        {})\n            {}\n            return ;;\n", patterns,
                                  bash_action(argument.values, commands));
        }
        options += fmt::format("        '{}') options='{}' ;;\n", command.name, own);
        // A command has one kind of operand, or several of which the last repeats.
        if (!positional.empty()) {
            operands +=
                fmt::format("        '{}') {} ;;\n", command.name, bash_action(positional.back()->values, commands));
        }
    }
    std::string keys;
    std::string words;
    for (const SettingKey& key : setting_keys()) {
        keys += (keys.empty() ? "" : " ") + key.path;
        if (!key.words.empty())
            words += fmt::format("        {}) _ringlock_words '{}' ;;\n", key.path, joined(key.words));
    }
    return fmt::format(R"(# bash completion of ringlock, made by `ringlock completion bash`
# shellcheck shell=bash disable=SC2207

_ringlock_words() {{
    COMPREPLY=($(compgen -W "$1" -- "$word"))
}}

# Files with one of these endings, and folders; without endings all files.
_ringlock_files() {{
    local ending
    compopt -o filenames 2>/dev/null
    if [[ $# -eq 0 ]]; then
        COMPREPLY=($(compgen -f -- "$word"))
        return
    fi
    COMPREPLY=($(compgen -d -- "$word"))
    for ending in "$@"; do
        COMPREPLY+=($(compgen -f -X "!*.$ending" -- "$word"))
    done
}}

_ringlock_folders() {{
    compopt -o filenames 2>/dev/null
    COMPREPLY=($(compgen -d -- "$word"))
}}

_ringlock_setting() {{
    compopt -o nospace 2>/dev/null
    COMPREPLY=($(compgen -S = -W '{keys}' -- "$word"))
}}

_ringlock_setting_value() {{
    case "$1" in
{words}    esac
}}

_ringlock() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD - 1]}}"
    local command='' options='' i equals=$((COMP_CWORD - 1))
    COMPREPLY=()
    for ((i = 1; i < COMP_CWORD; i++)); do
        case "${{COMP_WORDS[i]}}" in
            -*) ;;
            *)
                command="${{COMP_WORDS[i]}}"
                break ;;
        esac
    done
    # bash takes "=" for a word of its own.
    if [[ $word == '=' ]]; then
        word=''
        equals=$COMP_CWORD
        before='='
    fi
    local form=''
    if [[ $before == '=' ]]; then
        before="${{COMP_WORDS[equals - 1]}}"
        form='='
        if [[ ${{COMP_WORDS[equals - 2]}} == --set ]]; then
            _ringlock_setting_value "$before"
            return
        fi
    fi
    case "$command $before$form" in
{values}    esac
    case "$command" in
{options}    esac
    if [[ -z $command && $word != -* ]]; then
        _ringlock_words '{names}'
        return
    fi
    if [[ $word == -* ]]; then
        _ringlock_words "$options"
        return
    fi
    case "$command" in
{operands}    esac
}}

complete -F _ringlock ringlock
)",
                       fmt::arg("keys", keys), fmt::arg("words", words), fmt::arg("values", values),
                       fmt::arg("options", options), fmt::arg("names", names), fmt::arg("operands", operands));
}

// zsh

/// Text within [brackets] of _arguments.
std::string zsh_meaning(const std::string& text) {
    std::string out;
    for (const char c : short_meaning(text)) {
        if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
        out += c;
    }
    return out;
}

std::string zsh_action(const Values& values, const std::vector<CommandInfo>& commands) {
    switch (values.kind) {
        case Kind::words:
        case Kind::device:
        case Kind::command:
            return fmt::format("({})", joined(words_of(values, commands)));
        case Kind::file: {
            if (values.words.empty()) return "_files";
            // Brackets around one word alone would be qualifiers of the pattern.
            const std::string endings = fmt::format("{}", fmt::join(values.words, "|"));
            return fmt::format("_files -g \"*.{}\"", values.words.size() > 1 ? "(" + endings + ")" : endings);
        }
        case Kind::folder:
            return "_files -/";
        case Kind::setting:
            return "_ringlock_setting";
        case Kind::any:
            break;
    }
    return " ";
}

std::string zsh_arguments(const CommandInfo& command, const std::vector<CommandInfo>& commands) {
    std::string out;
    int number = 0;
    const auto positional = std::count_if(command.arguments.begin(), command.arguments.end(),
                                          [](const ArgumentInfo& a) { return a.is_positional; });
    for (const ArgumentInfo& argument : command.arguments) {
        if (argument.is_positional) {
            ++number;
            const std::string place = argument.repeats && number == positional ? "*" : std::to_string(number);
            out += fmt::format(" \\\n                {}",
                               single_quoted(fmt::format("{}:{}:{}", place, argument.names.front(),
                                                         zsh_action(argument.values, commands))));
            continue;
        }
        for (const std::string& name : argument.names) {
            std::string text = argument.repeats ? "*" : fmt::format("({})", joined(argument.names));
            text += fmt::format("{}[{}]", name + (takes_value(argument) && name.starts_with("--") ? "=" : ""),
                                zsh_meaning(argument.meaning));
            if (takes_value(argument)) {
                text += fmt::format(":{}:{}", argument.values.placeholder, zsh_action(argument.values, commands));
            }
            out += " \\\n                " + single_quoted(text);
        }
    }
    return out;
}

std::string zsh_completion(const std::vector<CommandInfo>& commands) {
    std::string names;
    std::string cases;
    for (const CommandInfo& command : commands) {
        if (command.name.empty()) continue;
        names += fmt::format("        {}\n", single_quoted(command.name + ":" + short_meaning(command.meaning)));
        cases += fmt::format("        {})\n            _arguments -s{} ;;\n", command.name,
                             zsh_arguments(command, commands));
    }
    std::string keys;
    std::string words;
    for (const SettingKey& key : setting_keys()) {
        keys += fmt::format("        {}\n", key.path);
        if (!key.words.empty()) words += fmt::format("            {}) compadd -- {} ;;\n", key.path, joined(key.words));
    }
    return fmt::format(R"(#compdef ringlock
# zsh completion of ringlock, made by `ringlock completion zsh`

_ringlock_setting() {{
    local -a keys
    keys=(
{keys}    )
    if compset -P '*='; then
        case ${{${{IPREFIX%=}}##*=}} in
{words}        esac
    else
        compadd -S = -- $keys
    fi
}}

_ringlock() {{
    local -a commands
    commands=(
{names}    )
    if (( CURRENT == 2 )); then
        if [[ $PREFIX == -* ]]; then
            _arguments '(-h --help)'{{-h,--help}}'[help]' '--version[version]'
        else
            _describe command commands
        fi
        return
    fi
    local command=$words[2]
    shift words
    (( CURRENT-- ))
    case $command in
{cases}    esac
}}

if [[ $funcstack[1] == _ringlock ]]; then
    _ringlock "$@"
else
    compdef _ringlock ringlock
fi
)",
                       fmt::arg("keys", keys), fmt::arg("words", words), fmt::arg("names", names),
                       fmt::arg("cases", cases));
}

// fish

std::string fish_action(const Values& values, const std::vector<CommandInfo>& commands) {
    switch (values.kind) {
        case Kind::words:
        case Kind::device:
        case Kind::command:
            return fmt::format(" -x -a {}", single_quoted(joined(words_of(values, commands))));
        case Kind::file:
            return values.words.empty() ? " -r -F"
                                        : fmt::format(" -r -k -a '(__ringlock_files {})'", joined(values.words));
        case Kind::folder:
            return " -x -a '(__fish_complete_directories)'";
        case Kind::setting:
            return " -x -a '(__ringlock_settings)'";
        case Kind::any:
            break;
    }
    return " -x";
}

std::string fish_completion(const std::vector<CommandInfo>& commands) {
    std::string settings;
    for (const SettingKey& key : setting_keys()) {
        if (key.words.empty()) settings += fmt::format("    echo {}=\n", key.path);
        for (const std::string& word : key.words) settings += fmt::format("    echo {}={}\n", key.path, word);
    }
    std::string out = fmt::format(R"(# fish completion of ringlock, made by `ringlock completion fish`

function __ringlock_files
    for ending in $argv
        __fish_complete_suffix .$ending
    end
end

function __ringlock_settings
{}end

complete -c ringlock -f
complete -c ringlock -n __fish_use_subcommand -s h -l help -d 'help'
complete -c ringlock -n __fish_use_subcommand -l version -d 'version and libraries'
)",
                                  settings);
    for (const CommandInfo& command : commands) {
        if (command.name.empty()) continue;
        out += fmt::format("complete -c ringlock -n __fish_use_subcommand -a {} -d {}\n", command.name,
                           single_quoted(short_meaning(command.meaning)));
        const std::string begin = fmt::format("complete -c ringlock -n '__fish_seen_subcommand_from {}'", command.name);
        for (const ArgumentInfo& argument : command.arguments) {
            out += begin;
            for (const std::string& name : argument.names) {
                if (argument.is_positional) continue;
                out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
            }
            if (takes_value(argument) || argument.is_positional) out += fish_action(argument.values, commands);
            if (!argument.is_positional) out += " -d " + single_quoted(short_meaning(argument.meaning));
            out += "\n";
        }
    }
    return out;
}

}  // namespace

void add_completion(CLI::App& root) {
    CLI::App* command =
        root.add_subcommand("completion", "Print the completion of commands, options, keys and values for a shell");
    const auto shell = std::make_shared<std::string>();
    command->add_option("SHELL", *shell, "bash, zsh or fish")->required();
    command->callback([shell, &root] {
        const std::vector<CommandInfo> commands = commands_of(root);
        if (*shell == "bash") return put(bash_completion(commands));
        if (*shell == "zsh") return put(zsh_completion(commands));
        if (*shell == "fish") return put(fish_completion(commands));
        throw InputError(
            fmt::format("{}: is not a shell that has a completion; there are bash, zsh and fish", printable(*shell)));
    });
}

}  // namespace ringlock::app
