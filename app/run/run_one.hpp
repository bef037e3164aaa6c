#pragma once
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/parts/manifest.hpp"
#include "analysis/study/experiment.hpp"
#include "analysis/study/summary.hpp"
#include "app/arguments.hpp"
#include "app/run/ranks.hpp"
#include "engine/store/provenance.hpp"

namespace ringlock::app {

/// The arguments of `run`.
struct RunArguments {
    std::vector<std::string> scenarios;
    std::optional<std::string> out;
    std::string plot;
    std::string shard;
    std::string checkpoint_every = "30";
    std::string print_schema;
    std::string threads = "0";
    Changes changes;
    bool resume = false;
    bool discard = false;
    bool json = false;
    bool quiet = false;
};

/// Seconds of --checkpoint-every; nothing if no checkpoints are to be written. Throws InputError.
std::optional<double> checkpoint_interval_s(const RunArguments& arguments);

/// The shard of --shard; nothing if the whole run is requested. Throws InputError.
std::optional<parts::Shard> shard_of(const RunArguments& arguments);

/// The file that the run writes: the result, or a shard of it.
std::filesystem::path target_of(const RunArguments& arguments, const std::filesystem::path& result);

/// Threads of --threads of one process; 0 means all cores, which processes on one machine share. Throws InputError.
int threads_of(const RunArguments& arguments, const Ranks& ranks);

/// Called with the outcome of a run before its file is complete, so that the outcome is not lost if the disk is full.
using OnOutcome = std::function<void(const study::Experiment& experiment, const std::vector<study::Summary>& summaries,
                                     const store::Provenance& provenance)>;

/// Simulates one scenario, or goes on with it, and writes its result or shard. False where --resume finds it finished.
///
/// \param ranks  the processes that simulate it together: this one is alone or leads
bool run_one(const RunArguments& arguments, const std::string& scenario_file, const std::filesystem::path& result,
             std::span<const char* const> command_line, const OnOutcome& on_outcome, const Ranks& ranks = {});

/// Whether the file is the result of the experiment, so that nothing is left to resume.
bool is_finished(const std::filesystem::path& result, const study::Experiment& plan);

}  // namespace ringlock::app
