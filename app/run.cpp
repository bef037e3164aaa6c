#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include "analysis/report/plot.hpp"
#include "analysis/study/result_file.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/output.hpp"
#include "app/study_output.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/ensemble/progress.hpp"
#include "engine/scenario/parse.hpp"
#include "engine/scenario/render.hpp"
#include "engine/simd/target.hpp"

namespace ringlock::app {

namespace {

struct Arguments {
    std::string scenario;
    std::optional<std::string> out;
    std::string plot;
    std::string shard;
    std::string print_schema;
    std::string threads = "0";
    Changes changes;
    bool resume = false;
    bool json = false;
    bool quiet = false;
};

void print_schema(const std::string& form) {
    if (form == "toml") {
        put(scenario::schema_text());
    } else if (form == "markdown") {
        put(scenario::schema_markdown());
    } else {
        put(scenario::schema_json());
    }
}

int thread_count(const std::string& asked) {
    constexpr int most = 4096;
    const auto threads = static_cast<int>(
        whole_number("--threads", asked, most, fmt::format("between 1 and {}, or 0 for all cores", most)));
    return threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

/// Refuses what the disk cannot hold, before hours are spent on it.
void check_room(const std::filesystem::path& out, const study::Experiment& plan) {
    std::error_code unknown;
    const auto folder = out.has_parent_path() ? out.parent_path() : std::filesystem::path(".");
    const std::filesystem::space_info space = std::filesystem::space(folder, unknown);
    const std::uint64_t bytes = study::expected_size_bytes(plan);
    if (unknown || bytes <= space.available) return;
    const bool records = plan.scenario.output.angle_record;
    throw InputError(
        fmt::format("{}: the result will take about {:.1f} GB, and the disk has {:.1f} GB; {}give a "
                    "place on another disk with -o",
                    out.string(), static_cast<double>(bytes) * 1e-9, static_cast<double>(space.available) * 1e-9,
                    records ? "set output.angle_record = false, or " : ""));
}

void run(const Arguments& arguments, std::span<const char* const> command_line) {
    if (!arguments.print_schema.empty()) return print_schema(arguments.print_schema);
    if (arguments.scenario.empty())
        throw InputError("run: give a scenario file, or --print-schema for an example of one");
    if (!arguments.shard.empty()) throw InputError("--shard is not there yet; run the whole ensemble");
    if (arguments.resume) throw InputError("--resume is not there yet; run the whole ensemble");
    const int threads = thread_count(arguments.threads);
    const scenario::Scenario scenario = load_scenario(arguments.scenario, arguments.changes);
    const std::filesystem::path out =
        arguments.out ? std::filesystem::path(*arguments.out)
                      : std::filesystem::path(arguments.scenario).filename().replace_extension(".h5");
    check_figure(arguments.plot);

    store::Provenance provenance = store::collect_provenance(command_line, threads, arguments.scenario);
    const auto start = std::chrono::steady_clock::now();
    study::Experiment plan(scenario);
    check_room(out, plan);
    study::ResultWriter writer(out, plan);
    const bool growing = scenario::asks(scenario.stop);
    // Of a lot that grows, the most that it can come to: its rule may stop it long before.
    const std::int64_t gyros =
        growing ? scenario.stop.most_gyros * static_cast<std::int64_t>(plan.points.size()) : plan.gyros();
    if (!arguments.quiet) {
        const study::Study& first = plan.points.front();
        const double duration_s = first.schedule.sample_interval_s * static_cast<double>(first.schedule.samples - 1);
        std::string points = plan.has_design() ? fmt::format("{} points, ", plan.points.size()) : "";
        if (growing) points += "until precise, at most ";
        tell(fmt::format("{}: {}{} gyros x {:.6g} s, {} arms, {} threads; the result will take {} {:.1f} MB\n",
                         arguments.scenario, points, gyros, duration_s, scenario.arms.size(), threads,
                         growing ? "up to" : "about", static_cast<double>(study::expected_size_bytes(plan)) * 1e-6));
    }
    ensemble::Progress progress(
        gyros, {.quiet = arguments.quiet, .total_turns = study::expected_turns(plan), .grows = growing});
    study::OnSamples on_samples;
    if (scenario.output.angle_record) {
        on_samples = [&](const study::SampledAngles& samples) { writer.write_samples(samples); };
    }
    const study::Experiment experiment = study::run(std::move(plan), threads, on_samples, {interrupted, &progress});
    check_interrupt();
    progress.stage("summing up");

    provenance.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    provenance.turns_per_s = static_cast<double>(experiment.turns()) / provenance.wall_s;
    provenance.instruction_set = simd::active_target();
    const std::vector<study::Summary> summaries = study::summarise(experiment);
    progress.stage("writing the result");
    writer.finish(experiment, summaries, provenance);
    if (!arguments.plot.empty()) report::write_svg(arguments.plot, experiment_figure(experiment, summaries));
    progress.finish();
    put(arguments.json ? experiment_json(experiment, summaries, provenance)
                       : experiment_text(experiment, summaries, provenance));
    if (!arguments.quiet) tell(fmt::format("result: {}\n", writer.path().string()));
}

}  // namespace

void add_run(CLI::App& root, std::span<const char* const> command_line) {
    CLI::App* command = root.add_subcommand("run", "Simulate the ensemble of a scenario and compare its arms");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("SCENARIO.toml", arguments->scenario,
                        "what to simulate; an empty file is the device of Gao & Deng 2007");
    command->add_option("-o,--output", arguments->out, "result file (default: the scenario's name with .h5, here)");
    command->add_option("--threads", arguments->threads, "threads (0: all cores); results do not depend on it")
        ->capture_default_str()
        ->type_name("N");
    add_settings(*command, arguments->changes);
    command->add_option("--seed", arguments->changes.seed, "replaces ensemble.seed")->type_name("S");
    command->add_option("--plot", arguments->plot, "also draw the figure into this SVG file");
    // Reserved, but not there yet: the help shows what can be used.
    command->add_option("--shard", arguments->shard)->group("");
    command->add_flag("--resume", arguments->resume)->group("");
    command->add_flag("--json", arguments->json, "print one JSON object instead of a table");
    command->add_flag("-q,--quiet", arguments->quiet, "no progress on standard error");
    // A flag, so that it does not take the word after it for its value.
    command
        ->add_flag(
            "--print-schema{toml}", arguments->print_schema,
            "print every key of a scenario with default, bounds and meaning, and end; =toml (default), =markdown "
            "or =json")
        ->check(CLI::IsMember({"toml", "markdown", "json"}));
    command->callback([arguments, command_line] { run(*arguments, command_line); });
}

}  // namespace ringlock::app
