#include "app/run/batch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "analysis/study/needs/cost.hpp"
#include "analysis/study/result/result_file.hpp"
#include "app/arguments.hpp"
#include "app/failure.hpp"
#include "app/output.hpp"
#include "app/run/run_text.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {

namespace {

namespace fs = std::filesystem;

/// Seconds for which each scenario is tried, so that the time of the batch can be estimated.
constexpr double trial_s = 0.5;

enum class State { waits, finished_before, done, failed };

const char* name_of(State state) {
    switch (state) {
        case State::waits:
            return "not run";
        case State::finished_before:
            return "finished before";
        case State::done:
            return "done";
        case State::failed:
            break;
    }
    return "failed";
}

struct Entry {
    std::string scenario;
    fs::path result;
    State state = State::waits;
    std::string error;
    double expected_s = 0.0;
    std::uint64_t expected_bytes = 0;
    double wall_s = 0.0;
    std::int64_t gyros = 0;
    std::vector<std::pair<std::string, std::optional<double>>> arw_deg_rt_h;  ///< of the first point's arms
};

class Batch {
   public:
    Batch(const RunArguments& arguments, std::span<const char* const> command_line)
        : arguments_(arguments), command_line_(command_line), folder_(arguments.out.value_or(".")) {
        std::map<fs::path, std::string> names;
        for (const std::string& scenario : arguments.scenarios) {
            const fs::path result = folder_ / fs::path(scenario).filename().replace_extension(".h5");
            const auto [there, fresh] = names.emplace(result, scenario);
            if (!fresh) {
                throw InputError(
                    fmt::format("{} and {}: the results of both would be written into {}; "
                                "give them different folders",
                                printable(there->second), printable(scenario), printable(result)));
            }
            Entry& entry = entries_.emplace_back();
            entry.scenario = scenario;
            entry.result = result;
        }
        std::error_code error;
        fs::create_directories(folder_, error);
        if (error) {
            throw InputError(fmt::format("{}: cannot be made: {}", printable(folder_), error.message()));
        }
    }

    void run() {
        plan();
        start_ = std::chrono::steady_clock::now();
        try {
            for (std::size_t i = 0; i < entries_.size(); ++i) {
                if (entries_[i].state != State::waits) continue;
                check_interrupt();
                run(i);
                write_summary();
            }
        } catch (const Interrupted& interrupted) {
            finish();
            throw Interrupted(fmt::format("{}; the same command continues the batch", interrupted.what()));
        }
        finish();
        const auto failed = std::count_if(entries_.begin(), entries_.end(),
                                          [](const Entry& entry) { return entry.state == State::failed; });
        if (failed > 0) throw RunError(fmt::format("{} of {} scenarios failed", failed, entries_.size()));
    }

   private:
    /// Time and disk of all that is to be run.
    void plan() {
        const int threads = thread_count(arguments_.threads);
        for (Entry& entry : entries_) {
            isolated(entry, [&] {
                const study::Experiment experiment(load_scenario(entry.scenario, arguments_.changes));
                entry.gyros = experiment.gyros();
                if (is_finished(entry.result, experiment)) {
                    entry.state = State::finished_before;
                    return;
                }
                entry.expected_bytes = study::expected_size_bytes(experiment);
                entry.expected_s = study::measure_cost(experiment, threads, trial_s, interrupted).wall_s();
            });
        }
        std::uint64_t bytes = 0;
        std::uint64_t largest = 0;
        std::size_t waiting = 0;
        for (const Entry& entry : entries_) {
            if (entry.state != State::waits) continue;
            ++waiting;
            bytes += entry.expected_bytes;
            largest = std::max(largest, entry.expected_bytes);
        }
        std::error_code unknown;
        const fs::space_info space = fs::space(folder_, unknown);
        // The files that a run keeps while it goes on take as much space as its result, in addition to it.
        if (!unknown && bytes + largest > space.available) {
            throw InputError(
                fmt::format("{}: the results will take {:.1f} GB, and the disk has {:.1f} GB; "
                            "run fewer, or set output.angle_record=false with --set",
                            printable(folder_), static_cast<double>(bytes + largest) * 1e-9,
                            static_cast<double>(space.available) * 1e-9));
        }
        if (!arguments_.quiet) {
            tell(fmt::format("batch: {} scenarios, {} to run; about {} and {:.1f} MB\n", entries_.size(), waiting,
                             duration_text(expected_left_s()), static_cast<double>(bytes) * 1e-6));
        }
    }

    /// Estimated from the trials, corrected by the time that the finished runs have taken.
    double expected_left_s() const {
        double left_s = 0.0;
        double done_s = 0.0;
        double expected_of_done_s = 0.0;
        for (const Entry& entry : entries_) {
            if (entry.state == State::waits) left_s += entry.expected_s;
            if (entry.state != State::done) continue;
            done_s += entry.wall_s;
            expected_of_done_s += entry.expected_s;
        }
        return expected_of_done_s > 0.0 ? left_s * done_s / expected_of_done_s : left_s;
    }

    void run(std::size_t i) {
        Entry& entry = entries_[i];
        if (!arguments_.quiet) {
            const std::chrono::duration<double> gone = std::chrono::steady_clock::now() - start_;
            tell(fmt::format("batch: {} of {}, {}; {} elapsed, about {} left\n", i + 1, entries_.size(),
                             printable(entry.scenario), duration_text(gone.count()), duration_text(expected_left_s())));
        }
        RunArguments one = arguments_;
        one.out = entry.result.string();
        one.resume = !arguments_.discard;
        isolated(entry, [&] {
            const auto start = std::chrono::steady_clock::now();
            run_one(one, entry.scenario, entry.result, command_line_,
                    [&](const study::Experiment& experiment, const std::vector<study::Summary>& summaries,
                        const store::Provenance&) {
                        entry.gyros = experiment.gyros();
                        for (const study::ArmSummary& arm : summaries.front().arms) {
                            entry.arw_deg_rt_h.emplace_back(arm.name, arm.arw_deg_rt_h.median);
                        }
                    });
            entry.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
            entry.state = State::done;
        });
    }

    template <class Work>
    void isolated(Entry& entry, Work&& work) {
        const auto fail = [&](const std::string& why) {
            entry.state = State::failed;
            entry.error = why;
            tell(fmt::format("ringlock: error: {}\n", why));
        };
        try {
            name_file_of_failure(entry.scenario, work);
        } catch (const Interrupted&) {
            throw;
        } catch (const std::exception& error) {
            fail(error.what());
        }
    }

    nlohmann::ordered_json json() const {
        auto runs = nlohmann::ordered_json::array();
        for (const Entry& entry : entries_) {
            nlohmann::ordered_json run{{"scenario", entry.scenario},
                                       {"result", entry.result.string()},
                                       {"state", name_of(entry.state)},
                                       {"error", nullptr},
                                       {"gyros", entry.gyros},
                                       {"wall_s", nullptr},
                                       {"arw_deg_rt_h", nlohmann::ordered_json::object()}};
            if (entry.state == State::failed) run["error"] = entry.error;
            if (entry.state == State::done) run["wall_s"] = entry.wall_s;
            for (const auto& [arm, arw] : entry.arw_deg_rt_h) {
                run["arw_deg_rt_h"][arm] = arw ? nlohmann::ordered_json(*arw) : nlohmann::ordered_json(nullptr);
            }
            runs.push_back(std::move(run));
        }
        return {{"runs", runs}};
    }

    void write_summary() const { write_text(folder_ / "batch.json", json_text(json(), 2) + "\n"); }

    void finish() const {
        write_summary();
        if (arguments_.json) return put(json_text(json()) + "\n");
        std::size_t scenario_width = 8;
        for (const Entry& entry : entries_) {
            scenario_width = std::max(scenario_width, printable(entry.scenario).size());
        };
        std::string text = fmt::format("{:<{}}  {:<15}  {:>10}  {:>12}  {}\n", "scenario", scenario_width, "state",
                                       "gyros", "time", "result");
        for (const Entry& entry : entries_) {
            const bool has_result = entry.state == State::done || entry.state == State::finished_before;
            const std::string first_line = entry.error.substr(0, entry.error.find('\n'));
            text += fmt::format("{:<{}}  {:<15}  {:>10}  {:>12}  {}\n", printable(entry.scenario), scenario_width,
                                name_of(entry.state), entry.gyros,
                                entry.state == State::done ? duration_text(entry.wall_s) : "",
                                has_result ? printable(entry.result) : first_line);
        }
        put(text);
    }

    const RunArguments& arguments_;
    std::span<const char* const> command_line_;
    fs::path folder_;
    std::vector<Entry> entries_;
    std::chrono::steady_clock::time_point start_;
};

}  // namespace

bool is_batch(const RunArguments& arguments) {
    if (arguments.scenarios.size() > 1) return true;
    std::error_code unknown;
    return arguments.out && (arguments.out->ends_with('/') || fs::is_directory(*arguments.out, unknown));
}

void run_batch(const RunArguments& arguments, std::span<const char* const> command_line) {
    if (!arguments.shard.empty())
        throw InputError("--shard: give one scenario; the shards of a batch are its scenarios");
    if (!arguments.plot.empty()) {
        throw InputError("--plot: a batch has no figure; ringlock analyze draws that of each result");
    }
    Batch(arguments, command_line).run();
}

}  // namespace ringlock::app
