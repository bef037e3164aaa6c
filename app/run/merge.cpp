#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/parts/folder.hpp"
#include "analysis/parts/shard.hpp"
#include "analysis/study/experiment_json.hpp"
#include "analysis/study/result/result_file.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/run/run_text.hpp"
#include "app/study/study_output.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/printable.hpp"
#include "engine/simd/target.hpp"

namespace ringlock::app {

namespace {

struct MergeArguments {
    std::string out;
    std::vector<std::string> shards;
    std::string threads = "0";
    bool missing = false;
    bool json = false;
    bool quiet = false;
};

std::vector<std::filesystem::path> files_of(const MergeArguments& arguments) {
    std::vector<std::filesystem::path> files(arguments.shards.begin(), arguments.shards.end());
    if (files.empty()) files = parts::shard_files(arguments.out);
    if (files.empty()) {
        throw InputError(
            fmt::format("{0}: there is no shard {0}.shard-I-of-N; name the shards, "
                        "or make them with ringlock run --shard I/N -o {0}",
                        arguments.out));
    }
    return files;
}

std::string list_of(const std::vector<parts::Shard>& shards) {
    std::vector<std::string> names;
    for (const parts::Shard& shard : shards) names.push_back(parts::to_string(shard));
    return fmt::format("{}", fmt::join(names, " "));
}

void merge(const MergeArguments& arguments, std::span<const char* const> command_line) {
    const int threads = thread_count(arguments.threads);
    const std::vector<std::filesystem::path> files = files_of(arguments);
    parts::ShardSet shards(files);
    study::Experiment plan(shards.manifest().scenario);
    const std::vector<parts::Shard> missing = shards.missing(plan);
    if (arguments.missing) {
        for (const parts::Shard& shard : missing) put(parts::to_string(shard) + "\n");
        return;
    }
    if (!missing.empty()) {
        throw InputError(fmt::format(
            "{}: gyros of {} shard{} are missing: {}; run these with ringlock run --shard I/N -o {}", arguments.out,
            missing.size(), missing.size() == 1 ? "" : "s", list_of(missing), arguments.out));
    }
    std::vector<NamedFile> named = {{"OUT.h5", arguments.out, NamedFile::Use::output}};
    for (const std::filesystem::path& file : files) named.push_back({"SHARD", file, NamedFile::Use::input});
    refuse_same_files(named);
    study::ResultWriter writer(arguments.out, plan);
    parts::Manifest whole = shards.manifest();
    whole.shard.reset();
    parts::Folder lock(arguments.out, whole, parts::Beginning::refuse, [](const auto&) {});

    study::predict_noise(plan.points, threads, {interrupted});
    shards.finished().take_up(plan.points, 0, std::numeric_limits<std::int64_t>::max());
    store::Provenance provenance = store::collect_provenance(command_line, threads, "");
    provenance.wall_s = shards.wall_s();
    provenance.turns_per_s = static_cast<double>(plan.turns()) / provenance.wall_s;
    provenance.instruction_set = simd::active_target();
    check_interrupt();
    std::vector<study::Summary> summaries;
    name_file_of_values(arguments.out, [&] { summaries = study::summarise(plan); });
    put(arguments.json ? study::experiment_json(plan, summaries, provenance)
                       : experiment_text(plan, summaries, provenance));
    if (plan.scenario.output.angle_record) {
        shards.finished().each_samples([&](const study::SampledAngles& samples) {
            check_interrupt();
            writer.write_samples(samples);
        });
    }
    check_interrupt();
    writer.finish(plan, summaries, provenance);
    if (!arguments.quiet) {
        tell(fmt::format("result: {} of {} shards, which can be removed\n", printable(writer.path()), files.size()));
    }
}

}  // namespace

void add_merge(CLI::App& root, std::span<const char* const> command_line) {
    CLI::App* command = root.add_subcommand("merge", "Make one result of the shards of a run (run --shard)");
    auto arguments = std::make_shared<MergeArguments>();
    command->add_option("OUT.h5", arguments->out, "result file: that of a run without shards")->required();
    command->add_option("SHARD", arguments->shards, "the shards (default: all OUT.h5.shard-I-of-N)");
    command->add_flag("--missing", arguments->missing, "print the shards that must be run (again), and end");
    command->add_option("--threads", arguments->threads, "threads (0: all cores)")
        ->capture_default_str()
        ->type_name("N");
    command->add_flag("--json", arguments->json, "print one JSON object instead of a table");
    command->add_flag("-q,--quiet", arguments->quiet, "nothing on standard error");
    command->callback(
        [arguments, command_line] { name_file_of_failure(arguments->out, [&] { merge(*arguments, command_line); }); });
}

}  // namespace ringlock::app
