#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "analysis/study/experiment_json.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/output.hpp"
#include "app/run/batch.hpp"
#include "app/run/ranks.hpp"
#include "app/run/run_member.hpp"
#include "app/run/run_one.hpp"
#include "app/study/study_output.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/text/render.hpp"

namespace ringlock::app {

namespace {

void print_schema(const std::string& form) {
    if (form == "toml") {
        put(scenario::schema_text());
    } else if (form == "markdown") {
        put(scenario::schema_markdown());
    } else {
        put(scenario::schema_json());
    }
}

std::filesystem::path output_of(const RunArguments& arguments) {
    if (arguments.out) return *arguments.out;
    return std::filesystem::path(arguments.scenarios.front()).filename().replace_extension(".h5");
}

void run(const RunArguments& arguments, std::span<const char* const> command_line) {
    if (!arguments.print_schema.empty()) return print_schema(arguments.print_schema);
    if (arguments.scenarios.empty())
        throw InputError("run: give a scenario file, or --print-schema for an example of one");
    if (is_batch(arguments)) {
        return with_ranks([&](const Ranks& ranks) {
            if (ranks.leader)
                throw InputError(
                    "run: several processes of mpirun cannot run a batch; "
                    "start one mpirun for each scenario");
            if (!ranks.member) run_batch(arguments, command_line);
            if (ranks.member) ranks.member->next_order();
        });
    }
    const std::string& scenario = arguments.scenarios.front();
    with_ranks([&](const Ranks& ranks) {
        if (ranks.member) {
            return run_member(arguments, scenario, output_of(arguments), *ranks.member, threads_of(arguments, ranks));
        }
        const auto print = [&](const auto& experiment, const auto& summaries, const auto& provenance) {
            put(arguments.json ? study::experiment_json(experiment, summaries, provenance)
                               : experiment_text(experiment, summaries, provenance));
        };
        run_one(arguments, scenario, output_of(arguments), command_line, print, ranks);
    });
}

}  // namespace

void add_run(CLI::App& root, std::span<const char* const> command_line) {
    CLI::App* command = root.add_subcommand("run", "Simulate the ensemble of a scenario and compare its arms");
    auto arguments = std::make_shared<RunArguments>();
    command->add_option("SCENARIO.toml", arguments->scenarios,
                        "scenario to simulate; an empty file is the device of Gao & Deng 2007. "
                        "Several scenarios are a batch: they run one after the other, "
                        "and those that are finished are left out");
    command->add_option("-o,--output", arguments->out,
                        "result file (default: the scenario's name with .h5, here), or the folder of a batch");
    command->add_option("--threads", arguments->threads, "threads (0: all cores); results do not depend on it")
        ->capture_default_str()
        ->type_name("N");
    add_settings(*command, arguments->changes);
    command->add_option("--seed", arguments->changes.seed, "replaces ensemble.seed")->type_name("S");
    command->add_option("--plot", arguments->plot, "also draw the figure into this SVG file");
    command
        ->add_option("--checkpoint-every", arguments->checkpoint_every,
                     "seconds between checkpoints, which keep finished gyros in OUTPUT.parts; 0: "
                     "each block of gyros by itself; never: none")
        ->capture_default_str()
        ->type_name("S");
    CLI::Option* resume = command->add_flag("--resume", arguments->resume,
                                            "continue a run that was interrupted, "
                                            "or begin if there is none");
    command->add_flag("--discard", arguments->discard, "begin anew and remove the checkpoints of an interrupted run")
        ->excludes(resume);
    command
        ->add_option("--shard", arguments->shard,
                     "simulate the I-th of N shards only, into OUTPUT.shard-I-of-N; ringlock merge puts them together")
        ->type_name("I/N");
    command->add_flag("--json", arguments->json, "print one JSON object instead of a table");
    command->add_flag("-q,--quiet", arguments->quiet, "no progress on standard error");
    // A flag, so that it does not take the word after it for its value.
    command
        ->add_flag("--print-schema{toml}", arguments->print_schema,
                   "print every key of a scenario with default, bounds and meaning, and end; =toml (default), "
                   "=markdown or =json")
        ->check(CLI::IsMember({"toml", "markdown", "json"}));
    command->callback([arguments, command_line] {
        name_file_of_failure(fmt::format("{}", fmt::join(arguments->scenarios, ", ")),
                             [&] { run(*arguments, command_line); });
    });
}

}  // namespace ringlock::app
