#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "analysis/study/experiment.hpp"
#include "analysis/study/needs/cost.hpp"
#include "analysis/study/needs/room.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/run/run_text.hpp"
#include "app/run/slurm_script.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/version.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::app {

namespace {

namespace fs = std::filesystem;

constexpr double trial_s = 3.0;

struct SubmitArguments {
    std::string scenario;
    std::optional<std::string> out;
    std::string shards_of = "20min";
    std::string threads = "0";
    Changes changes;
    bool slurm = false;
    bool quiet = false;
};

/// Blocks of gyros, of which each shard needs one for each thread at least.
std::int64_t blocks_of(const study::Experiment& plan) {
    std::int64_t blocks = 0;
    for (const study::Study& point : plan.points) {
        blocks += (static_cast<std::int64_t>(point.gyros.size()) + simd::lanes - 1) / simd::lanes;
    }
    return blocks;
}

std::int64_t minutes(double seconds) { return static_cast<std::int64_t>(std::ceil(seconds / 60.0)); }

void submit(const SubmitArguments& arguments) {
    if (!arguments.slurm) throw InputError("submit: name the batch system; there is --slurm");
    const double shard_s = duration_s("--shards-of", arguments.shards_of);
    const int threads = thread_count(arguments.threads);
    const scenario::Scenario scenario = load_scenario(arguments.scenario, arguments.changes);
    if (scenario::asks(scenario.stop)) {
        throw InputError(
            "submit: a lot with a stopping rule grows as a whole and cannot be divided; "
            "give ensemble.gyros and no [stop]");
    }
    const fs::path result =
        arguments.out ? fs::path(*arguments.out) : fs::path(arguments.scenario).filename().replace_extension(".h5");
    refuse_same_files(
        {{"SCENARIO", arguments.scenario, NamedFile::Use::input}, {"-o", result, NamedFile::Use::output}});
    const study::Experiment plan(scenario);
    if (!arguments.quiet) tell(fmt::format("measuring for {:g} s how long the run takes ...\n", trial_s));
    const study::Cost cost = study::measure_cost(plan, threads, trial_s, interrupted);
    const std::int64_t most = std::max<std::int64_t>(1, blocks_of(plan) / threads);
    const std::int64_t wanted = std::max<std::int64_t>(1, std::llround(std::ceil(cost.wall_s() / shard_s)));
    const std::int64_t shards = std::min(wanted, most);
    const double each_s = cost.wall_s() / static_cast<double>(shards);

    SlurmJobs jobs;
    jobs.program = fs::canonical("/proc/self/exe").string();
    jobs.scenario = fs::absolute(arguments.scenario).string();
    jobs.result = fs::absolute(result).string();
    for (const std::string& setting : arguments.changes.settings) {
        jobs.options.insert(jobs.options.end(), {"--set", setting});
    }
    if (arguments.changes.seed) jobs.options.insert(jobs.options.end(), {"--seed", *arguments.changes.seed});
    jobs.note =
        fmt::format("ringlock {} ({}): {:.3g} turns at {:.3g} a second on {} threads are {}; {} shards of about {}",
                    version(), git_hash(), static_cast<double>(cost.turns), cost.turns_per_s, threads,
                    duration_text(cost.wall_s()), shards, duration_text(each_s));
    jobs.shards = shards;
    jobs.threads = threads;
    // A machine of the cluster may be half as fast as this one, and another's libraries may be larger.
    constexpr double margin = 2.0;
    constexpr std::int64_t least_min = 10;
    jobs.memory_mb = static_cast<std::int64_t>(
        std::ceil(margin * 1e-6 * static_cast<double>(study::expected_memory_bytes(scenario, threads))));
    jobs.shard_limit_min = minutes(margin * each_s) + least_min;
    jobs.merge_limit_min = minutes(0.05 * cost.wall_s()) + 3 * least_min;
    put(slurm_script(jobs));
    if (arguments.quiet) return;
    tell(jobs.note + "\n");
    constexpr std::int64_t array_by_default = 1000;
    if (shards > array_by_default) {
        tell(
            fmt::format("{} shards: Slurm takes arrays of up to {} unless MaxArraySize says more; "
                        "longer --shards-of makes fewer\n",
                        shards, array_by_default));
    }
    if (shards < wanted) {
        tell(
            fmt::format("{} is shorter than the time of a block of gyros for each thread; "
                        "fewer --threads make more shards\n",
                        arguments.shards_of));
    }
}

}  // namespace

void add_submit(CLI::App& root) {
    CLI::App* command = root.add_subcommand("submit", "Print a script that runs a scenario in shards on a cluster");
    auto arguments = std::make_shared<SubmitArguments>();
    command->add_option("SCENARIO.toml", arguments->scenario, "scenario to simulate")->required();
    command->add_flag("--slurm", arguments->slurm,
                      "for Slurm: bash SCRIPT submits an array of shards and the merge that waits for them");
    command->add_option("--shards-of", arguments->shards_of, "how long a shard is to take: 90s, 20min, 2h")
        ->capture_default_str()
        ->type_name("TIME");
    command->add_option("-o,--output", arguments->out, "result file (default: the scenario's name with .h5, here)");
    command->add_option("--threads", arguments->threads, "threads of a shard (0: all cores of this machine)")
        ->capture_default_str()
        ->type_name("N");
    add_settings(*command, arguments->changes);
    command->add_option("--seed", arguments->changes.seed, "replaces ensemble.seed")->type_name("S");
    command->add_flag("-q,--quiet", arguments->quiet, "nothing on standard error");
    command->callback([arguments] { name_file_of_failure(arguments->scenario, [&] { submit(*arguments); }); });
}

}  // namespace ringlock::app
