#include "app/run/run_member.hpp"

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/parts/checkpoints.hpp"
#include "analysis/parts/folder.hpp"
#include "analysis/parts/manifest.hpp"
#include "analysis/study/experiment.hpp"
#include "app/arguments.hpp"
#include "app/failure.hpp"
#include "app/run/session.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/ensemble/progress/observer.hpp"

namespace ringlock::app {

namespace {

/// The run as this process reads it; the same as the leader's.
parts::Manifest same_run(const RunArguments& arguments, const std::string& scenario_file, const parts::Order& order,
                         int rank) {
    const parts::Manifest leaders = parts::parse_manifest(order.manifest, "the run that rank 0 leads");
    const parts::Manifest mine =
        parts::manifest_of(load_scenario(scenario_file, arguments.changes), shard_of(arguments));
    const std::vector<std::string> other = parts::differences(leaders, mine);
    if (other.empty()) return mine;
    throw InputError(
        fmt::format("{}: rank {} has another scenario or program than rank 0; they differ in\n  {}\n"
                    "Give all machines the same files",
                    scenario_file, rank, fmt::join(other, "\n  ")));
}

}  // namespace

void run_member(const RunArguments& arguments, const std::string& scenario_file, const std::filesystem::path& result,
                parts::Member& member, int threads) {
    const int rank = member.rank();
    std::optional<study::Experiment> plan;
    std::unique_ptr<parts::Checkpoints> checkpoints;
    const auto keep = [&] { return !checkpoints || checkpoints->keep_what_can_be(); };
    try {
        while (const std::optional<parts::Order> order = member.next_order()) {
            if (!plan) {
                const parts::Manifest run = same_run(arguments, scenario_file, *order, rank);
                plan.emplace(run.scenario);
                parts::Checkpoints::Options options;
                options.every_s = checkpoint_interval_s(arguments).value_or(options.every_s);
                checkpoints = std::make_unique<parts::Checkpoints>(
                    parts::folder_of(target_of(arguments, result)), run, member, *plan, options,
                    [rank](const std::string& line) { say(fmt::format("rank {}: {}", rank, line)); });
                checkpoints->begin(nullptr);
            }
            if (scenario::asks(plan->scenario.stop)) {
                for (study::Study& point : plan->points) study::extend(point, order->gyros);
            }
            study::run(plan->points, order->stretches, threads,
                       [&](std::size_t point, std::int64_t first, std::size_t gyros) {
                           return checkpoints->keeper(point, first, gyros);
                       },
                       {interrupted, &member.observer(), &member});
            checkpoints->keep_all();
            member.report(checkpoints->finished().files());
        }
    } catch (const Interrupted&) {
        if (keep()) throw EndQuietly{ended_by_signal + interrupt_signal()};
        throw RunError(fmt::format("rank {}: not all of its finished gyros could be kept", rank));
    } catch (const RunError& error) {
        const bool all = keep();
        throw RunError(fmt::format("rank {}: {}{}", rank, error.what(),
                                   all ? "" : "; not all of its finished gyros could be kept"));
    }
}

}  // namespace ringlock::app
