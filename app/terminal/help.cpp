#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "app/terminal/command_line.hpp"

namespace ringlock::app {
namespace {

constexpr std::size_t help_columns = 100;

/// Words of a text in lines of that many columns.
std::vector<std::string> lines_of(std::string_view text, std::size_t columns) {
    std::vector<std::string> lines;
    while (!text.empty()) {
        const std::size_t newline = text.find('\n');
        std::size_t end = std::min(newline, text.size());
        if (end > columns) {
            end = text.rfind(' ', columns);
            if (end == std::string_view::npos || end == 0) end = std::min(text.find_first_of(" \n"), text.size());
        }
        lines.emplace_back(text.substr(0, end));
        text.remove_prefix(std::min(text.size(), end + 1));
    }
    return lines;
}

/// Help in lines of at most 100 columns.
class WrappedHelp : public CLI::Formatter {
   public:
    WrappedHelp() { column_width(left); }

    std::string make_option(const CLI::Option* option, bool is_positional) const override {
        return entry(make_option_name(option, is_positional) + make_option_opts(option), make_option_desc(option));
    }
    std::string make_subcommand(const CLI::App* command) const override {
        return entry(command->get_name(), command->get_description(), 14);
    }
    std::string make_description(const CLI::App* command) const override {
        std::string out;
        for (const std::string& line : lines_of(command->get_description(), help_columns)) out += line + "\n";
        return out;
    }

   private:
    static constexpr std::size_t left = 30;

    static std::string entry(const std::string& name, const std::string& meaning, std::size_t width = left) {
        std::string out = "  " + name;
        const std::vector<std::string> lines = lines_of(meaning, help_columns - width);
        bool begins = out.size() + 2 > width;  // on a line of its own
        if (begins) out += '\n';
        for (const std::string& line : lines) {
            out += begins ? std::string(width, ' ') : std::string(width - std::min(width, out.size()), ' ');
            out += line + "\n";
            begins = true;
        }
        if (lines.empty() && !out.ends_with('\n')) out += '\n';
        return out;
    }
};

/// Examples of every command; tests run each of them. Files are those that earlier commands of this list make, a
/// scenario "study.toml" and a log "log.csv".
const std::map<std::string, std::vector<Example>>& all_examples() {
    static const std::map<std::string, std::vector<Example>> all = {
        {"run",
         {{"ringlock run study.toml -o out.h5", "simulate, compare the arms"},
          {"ringlock run study.toml --set gyro.lockin_threshold_deg_h=140", "the same with another key"},
          {"ringlock run study.toml -o lot.h5 --shard 1/2", "half of it, for another machine"},
          {"ringlock run --print-schema", "all keys of a scenario"}}},
        {"analyze",
         {{"ringlock analyze out.h5", "the comparison again"},
          {"ringlock analyze out.h5 --plot out.svg", "and its figure"},
          {"ringlock analyze out.h5 --tau 1s,2s --json", "deviations at these times, as JSON"}}},
        {"allan",
         {{"ringlock allan log.csv --rate 200 --kind rate --unit rad/s --column gx", "one axis of a log"},
          {"ringlock allan gyro.h5 --rate file --kind increment --unit arcsec --column angle_increment_arcsec",
           "a record"},
          {"ringlock allan log.csv --rate 200 --kind rate --unit rad/s --column gx,gy --explain", "in sentences"}}},
        {"validate", {{"ringlock validate study.toml", "a scenario"}, {"ringlock validate gyro.h5", "a record"}}},
        {"import",
         {{"ringlock import log.csv -o log.h5 --column gx=rate --unit rad/s --rate 200", "a log as a record"}}},
        {"closure",
         {{"ringlock closure turns.h5", "what a model of the gyro lacks"},
          {"ringlock closure turns.h5 --model study.toml -o closed", "with a report in the folder closed"}}},
        {"record",
         {{"ringlock record study.toml -o turns.h5", "a record of turns"},
          {"ringlock record study.toml -o gyro.h5 --set record.kind=samples", "a record of samples"}}},
        {"devices",
         {{"ringlock devices", "the gyros that a scenario can name"},
          {"ringlock devices --json", "with the source of each constant"}}},
        {"merge",
         {{"ringlock merge lot.h5", "all shards of lot.h5 in this folder"},
          {"ringlock merge lot.h5 --missing", "shards that have still to be run"}}},
        {"status", {{"ringlock status lot.h5", "how far the run and its shards are"}}},
        {"submit", {{"ringlock submit study.toml --slurm --shards-of 2h", "a script for an array of jobs"}}},
        {"replay",
         {{"ringlock replay out.h5 --arm noise_injected --gyro 1", "every turn of one gyro"},
          {"ringlock replay out.h5 --arm uncompensated --gyro 0 --from 1 --to 2 -o u.h5", "a part of them"}}},
        {"report", {{"ringlock report out.h5 -o report.html", "the study as a page"}}},
        {"export",
         {{"ringlock export out.h5 --csv -o gyros.csv", "a row for each arm and gyro"},
          {"ringlock export out.h5 --tables", "the tables of the file"},
          {"ringlock export out.h5 --csv --table allan", "one of them, to standard output"},
          {"ringlock export out.h5 --matlab -o out.mat", "all of it for MATLAB"},
          {"ringlock export out.h5 --json --only arms/noise_injected/noise", "a part of it"}}},
        {"new",
         {{"ringlock new -o first.toml", "the device of Gao and Deng (2007)"},
          {"ringlock new triangle-51mm -o small.toml", "one of ringlock devices"}}},
        {"completion",
         {{"ringlock completion bash >ringlock.bash", "then: source ringlock.bash"},
          {"ringlock completion zsh >_ringlock", "in a folder of fpath"},
          {"ringlock completion fish >ringlock.fish", "in ~/.config/fish/completions"}}},
        {"man",
         {{"ringlock man run >ringlock-run.1", "then: man ./ringlock-run.1"},
          {"ringlock man scenario", "the keys of a scenario"}}},
    };
    return all;
}

std::string footer_of(const std::vector<Example>& examples) {
    std::size_t widest = 0;
    for (const Example& example : examples) widest = std::max(widest, example.command_line.size());
    std::string out = examples.size() > 1 ? "Examples:\n" : "Example:\n";
    for (const Example& example : examples) {
        constexpr std::size_t indent = 2;
        const bool fits = indent + widest + 4 + example.meaning.size() <= help_columns;
        out += fits ? fmt::format("  {:<{}}  # {}\n", example.command_line, widest, example.meaning)
                    : fmt::format("  {}\n      # {}\n", example.command_line, example.meaning);
    }
    out.pop_back();
    return out;
}

}  // namespace

std::vector<Example> examples_of(const std::string& command) {
    const auto found = all_examples().find(command);
    return found == all_examples().end() ? std::vector<Example>() : found->second;
}

void finish_help(CLI::App& root) {
    const auto formatter = std::make_shared<WrappedHelp>();
    root.formatter(formatter);
    for (CLI::App* command : root.get_subcommands([](CLI::App*) { return true; })) {
        command->formatter(formatter);
        for (CLI::Option* option : command->get_options([](CLI::Option*) { return true; })) {
            const std::string name = option->get_positional()       ? option->get_name(true, false)
                                     : option->get_lnames().empty() ? ""
                                                                    : "--" + option->get_lnames().back();
            const std::string placeholder = values_of(command->get_name(), name).placeholder;
            const bool takes_value = option->get_items_expected_max() > 0;
            if (option->get_positional()) {
                option->type_name("");
            } else if (takes_value && !placeholder.empty()) {
                option->type_name(placeholder);
            }
        }
        const std::vector<Example> examples = examples_of(command->get_name());
        // A command without a footer of its own has that of the program.
        if (command->get_footer() == root.get_footer() && !examples.empty()) {
            command->footer(fmt::format("{}\n\n{}", footer_of(examples), root.get_footer()));
        }
    }
}

}  // namespace ringlock::app
