#include "app/run/run_one.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "analysis/parts/checkpoints.hpp"
#include "analysis/parts/folder.hpp"
#include "analysis/parts/manifest.hpp"
#include "analysis/parts/shard.hpp"
#include "analysis/report/plot.hpp"
#include "analysis/study/needs/room.hpp"
#include "analysis/study/result/result_file.hpp"
#include "app/arguments.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/run/room.hpp"
#include "app/run/session.hpp"
#include "app/study/study_output.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/version.hpp"
#include "engine/ensemble/progress/progress.hpp"
#include "engine/simd/target.hpp"

namespace ringlock::app {

namespace {

parts::Beginning beginning_of(const RunArguments& arguments) {
    if (arguments.resume) return parts::Beginning::resume;
    return arguments.discard ? parts::Beginning::discard : parts::Beginning::refuse;
}

/// Memory and disk of the run, and how it could do with less.
Needs needs_of(const scenario::Scenario& scenario, int threads, bool checkpoints, std::int64_t shards) {
    // Samples are stored twice while the result is made from the checkpoints.
    const auto disk_bytes = [=] {
        return study::expected_disk_bytes(scenario) * (checkpoints ? 2 : 1) / static_cast<std::uint64_t>(shards);
    };
    std::string less_disk = "run fewer gyros at a time";
    if (scenario.output.angle_record) {
        less_disk = "set output.angle_record = false";
        if (checkpoints && shards == 1) less_disk += ", or give --checkpoint-every never, which takes half of it";
    }
    return {study::expected_memory_bytes(scenario, threads), disk_bytes,
            "run fewer gyros at a time (ensemble.gyros, stop.most_gyros, design.points), or fewer arms", less_disk};
}

void announce(const Task& task, std::int64_t gyros) {
    const study::Study& first = task.plan.points.front();
    const double duration_s = first.schedule.sample_interval_s * static_cast<double>(first.schedule.samples - 1);
    std::string points = task.plan.has_design() ? fmt::format("{} points, ", task.plan.points.size()) : "";
    if (task.grows()) points += "until precise, at most ";
    if (task.shard) points += fmt::format("shard {}, ", parts::to_string(*task.shard));
    const std::string processes = task.leader ? fmt::format("{} processes x ", 1 + task.leader->members()) : "";
    tell(fmt::format("{}: {}{} gyros x {:.6g} s, {} arms, {}{} threads; the result will take {} {:.1f} MB\n",
                     task.scenario_file, points, gyros, duration_s, task.plan.scenario.arms.size(), processes,
                     task.threads, task.grows() ? "up to" : "about",
                     static_cast<double>(study::expected_size_bytes(task.plan)) * 1e-6));
}

/// The outcome, the result and the figure of a run that is through.
class Outcome {
   public:
    Outcome(const RunArguments& arguments, store::Provenance provenance, const OnOutcome& on_outcome)
        : arguments_(arguments),
          provenance_(std::move(provenance)),
          on_outcome_(on_outcome),
          figure_(claim_figure(arguments.plot)) {}

    /// \param before_s  wall time of earlier processes that went into it
    void spent(const study::Experiment& experiment, double before_s) {
        const std::chrono::duration<double> gone = std::chrono::steady_clock::now() - start_;
        provenance_.wall_s = before_s + gone.count();
        provenance_.turns_per_s = static_cast<double>(experiment.turns()) / provenance_.wall_s;
        provenance_.instruction_set = simd::active_target();
    }
    double wall_s() const { return provenance_.wall_s; }

    void write(study::ResultWriter& writer, const study::Experiment& experiment, ensemble::Progress& progress,
               const std::function<void()>& write_samples) {
        progress.stage("summing up");
        const std::vector<study::Summary> summaries = study::summarise(experiment);
        progress.finish();
        try {
            on_outcome_(experiment, summaries, provenance_);
        } catch (const RunError&) {
            not_reported_ = std::current_exception();
        }
        write_samples();
        check_interrupt();
        writer.finish(experiment, summaries, provenance_);
        if (figure_) report::write_figure(*figure_, experiment_figure(experiment, summaries));
        if (!arguments_.quiet) tell(fmt::format("result: {}\n", printable(writer.path())));
    }

    /// A table that cannot be printed must not prevent the result from being written; it is a failure once the result
    /// is complete.
    void fail_if_not_reported() const {
        if (not_reported_) std::rethrow_exception(not_reported_);
    }

   private:
    const RunArguments& arguments_;
    store::Provenance provenance_;
    const OnOutcome& on_outcome_;
    std::unique_ptr<AtomicPath> figure_;
    std::exception_ptr not_reported_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Without checkpoints: samples go into the result as they come.
void run_without_checkpoints(const RunArguments& arguments, Task task, Outcome outcome) {
    study::ResultWriter writer(task.target, task.plan);
    parts::Folder folder(task.target, parts::manifest_of(task.plan.scenario, {}), beginning_of(arguments), say);
    const std::int64_t gyros = gyros_of(task);
    if (!task.quiet) announce(task, gyros);
    ensemble::Progress progress(
        gyros, {.quiet = task.quiet, .total_turns = study::expected_turns(task.plan), .grows = task.grows()});
    study::OnSamples on_samples;
    if (task.plan.scenario.output.angle_record) {
        on_samples = [&](const study::SampledAngles& samples) { writer.write_samples(samples); };
    }
    const study::Experiment experiment =
        study::run(std::move(task.plan), task.threads, on_samples, {interrupted, &progress});
    check_interrupt();
    outcome.spent(experiment, 0.0);
    outcome.write(writer, experiment, progress, [] {});
    outcome.fail_if_not_reported();
}

void run_whole(const RunArguments& arguments, Task task, double every_s, Outcome outcome) {
    study::ResultWriter writer(task.target, task.plan);
    Session session(std::move(task), every_s, beginning_of(arguments));
    parts::Checkpoints& checkpoints = session.checkpoints();
    if (!arguments.quiet) announce(session.task(), session.all_gyros());
    session.keep_whatever_happens([&] {
        const study::Experiment experiment =
            study::run(std::move(session.task().plan), session.task().threads, checkpoints, session.monitor());
        check_interrupt();
        outcome.spent(experiment, 3600.0 * checkpoints.hours_before());
        outcome.write(writer, experiment, session.progress(), [&] {
            if (!experiment.scenario.output.angle_record) return;
            checkpoints.keep_all();
            checkpoints.finished().each_samples([&](const study::SampledAngles& samples) {
                check_interrupt();
                writer.write_samples(samples);
            });
        });
        session.remove_folder();
    });
    outcome.fail_if_not_reported();
}

void run_shard(const RunArguments& arguments, Task task, double every_s, Outcome outcome) {
    AtomicPath claim(task.target);
    Session session(std::move(task), every_s, beginning_of(arguments));
    parts::Checkpoints& checkpoints = session.checkpoints();
    if (!arguments.quiet) announce(session.task(), session.all_gyros());
    study::Experiment& plan = session.task().plan;
    session.keep_whatever_happens([&] {
        const std::vector<study::Stretch> to_do =
            checkpoints.take_up(plan.points, 0, std::numeric_limits<std::int64_t>::max());
        study::run(
            plan.points, to_do, session.task().threads,
            [&](std::size_t point, std::int64_t first, std::size_t gyros) {
                return checkpoints.keeper(point, first, gyros);
            },
            session.monitor());
        checkpoints.collect(plan.points, 0, std::numeric_limits<std::int64_t>::max());
        session.progress().finish();
        checkpoints.keep_all();
        check_interrupt();
        outcome.spent(plan, 3600.0 * checkpoints.hours_before());
        parts::write_shard(claim.partial(), session.folder().manifest(), checkpoints.finished(), outcome.wall_s());
        claim.commit();
        session.remove_folder();
    });
    const std::string file = claim.target().string();
    const std::string shard = parts::to_string(*session.task().shard);
    if (arguments.json) {
        put(json_text(nlohmann::ordered_json{{"shard", shard}, {"gyros", session.all_gyros()}, {"file", file}}) + "\n");
    } else if (!arguments.quiet) {
        tell(fmt::format("shard {}: {}; ringlock merge {} makes the result of all shards\n", shard, printable(file),
                         printable(session.task().result)));
    }
}

bool is_shard_of(const std::filesystem::path& file, const parts::Manifest& manifest) {
    return store::is_part(file) && parts::differences(parts::read_manifest(file), manifest).empty();
}

void refuse_what_does_not_go_together(const RunArguments& arguments, const scenario::Scenario& scenario,
                                      const Ranks& ranks) {
    if (ranks.leader && arguments.checkpoint_every == "never") {
        throw InputError(
            "--checkpoint-every never: the processes of mpirun pass on finished gyros as checkpoints; give seconds");
    }
    if (arguments.shard.empty()) return;
    if (scenario::asks(scenario.stop)) {
        throw InputError(
            "--shard: a lot with a stopping rule grows as a whole and cannot be divided; give ensemble.gyros "
            "and no [stop], or run it without --shard");
    }
    if (!arguments.plot.empty()) {
        throw InputError(
            "--shard with --plot: a shard has no figure; ringlock analyze draws that of the merged result");
    }
    if (arguments.checkpoint_every == "never") {
        throw InputError("--shard with --checkpoint-every never: a shard is made of its checkpoints; give seconds");
    }
}

}  // namespace

std::optional<double> checkpoint_interval_s(const RunArguments& arguments) {
    const std::string& asked = arguments.checkpoint_every;
    if (asked == "never") return std::nullopt;
    double seconds = 0.0;
    const auto [end, error] = std::from_chars(asked.data(), asked.data() + asked.size(), seconds);
    if (error != std::errc() || end != asked.data() + asked.size() || !(seconds >= 0.0 && seconds <= 86400.0)) {
        throw InputError(fmt::format("--checkpoint-every {}: must be seconds between 0 and 86400, or never", asked));
    }
    return seconds;
}

std::optional<parts::Shard> shard_of(const RunArguments& arguments) {
    if (arguments.shard.empty()) return std::nullopt;
    return parts::parse_shard(arguments.shard);
}

std::filesystem::path target_of(const RunArguments& arguments, const std::filesystem::path& result) {
    const std::optional<parts::Shard> shard = shard_of(arguments);
    return shard ? parts::shard_file(result, *shard) : result;
}

int threads_of(const RunArguments& arguments, const Ranks& ranks) {
    const int asked = thread_count(arguments.threads);
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    // A launcher that binds its processes to cores has divided these already.
    const bool are_divided = static_cast<long>(std::thread::hardware_concurrency()) < cores;
    if (arguments.threads != "0" || are_divided) return asked;
    return std::max(1, asked / ranks.of_this_machine);
}

bool is_finished(const std::filesystem::path& result, const study::Experiment& plan) {
    // A run that was interrupted before it could remove its checkpoints is finished. A run that was to replace the
    // result of another program version is not: that result is of the same study, too, but of another commit.
    return study::is_result_of(result, plan) && (parts::part_files(parts::folder_of(result)).empty() ||
                                                 study::read_provenance(result).git_hash == git_hash());
}

bool run_one(const RunArguments& arguments, const std::string& scenario_file, const std::filesystem::path& result,
             std::span<const char* const> command_line, const OnOutcome& on_outcome, const Ranks& ranks) {
    const int threads = threads_of(arguments, ranks);
    const std::optional<double> every_s = checkpoint_interval_s(arguments);
    const std::optional<parts::Shard> shard = shard_of(arguments);
    const scenario::Scenario scenario = load_scenario(scenario_file, arguments.changes);
    refuse_what_does_not_go_together(arguments, scenario, ranks);
    const std::filesystem::path target = target_of(arguments, result);
    refuse_same_files({{"SCENARIO", scenario_file, NamedFile::Use::input},
                       {"-o", target, NamedFile::Use::output},
                       {"--plot", arguments.plot, NamedFile::Use::output}});
    Needs needs = needs_of(scenario, threads, every_s.has_value(), shard ? shard->count : 1);
    needs.memory_bytes *= static_cast<std::uint64_t>(ranks.of_this_machine);
    check_room(target, needs, arguments.quiet);

    Outcome outcome(arguments, store::collect_provenance(command_line, threads, scenario_file), on_outcome);
    if (ranks.leader) ranks.leader->use(threads);
    Task task{scenario_file,  study::Experiment(scenario), result, target, shard, threads, ranks.leader,
              arguments.quiet};
    const parts::Manifest manifest = parts::manifest_of(scenario, shard);
    const bool is_there = shard ? is_shard_of(task.target, manifest) : is_finished(result, task.plan);
    if (arguments.resume && is_there) {
        // The checkpoints that a run kept next to its result are of no use any more.
        parts::Folder(task.target, manifest, parts::Beginning::resume, say).remove();
        tell(fmt::format("{}: is finished; there is nothing to resume\n", printable(task.target)));
        return false;
    }
    std::error_code unknown;
    if (shard && !is_there && std::filesystem::exists(task.target, unknown)) {
        throw InputError(
            fmt::format("{}: the file exists and is not a shard of this run; it is kept. "
                        "Give another name with -o, or remove it",
                        printable(task.target)));
    }
    if (shard) {
        run_shard(arguments, std::move(task), *every_s, std::move(outcome));
    } else if (every_s) {
        run_whole(arguments, std::move(task), *every_s, std::move(outcome));
    } else {
        run_without_checkpoints(arguments, std::move(task), std::move(outcome));
    }
    return true;
}

}  // namespace ringlock::app
