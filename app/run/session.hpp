#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "analysis/parts/checkpoints.hpp"
#include "analysis/parts/folder.hpp"
#include "analysis/parts/manifest.hpp"
#include "analysis/parts/team.hpp"
#include "analysis/study/experiment.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/ensemble/progress/progress.hpp"

namespace ringlock::app {

/// A run: the experiment to simulate and the file to write.
struct Task {
    std::string scenario_file;
    study::Experiment plan;
    std::filesystem::path result;
    std::filesystem::path target;  ///< result or shard
    std::optional<parts::Shard> shard;
    int threads = 1;                  ///< of this process
    parts::Leader* leader = nullptr;  ///< where several processes simulate it
    bool quiet = false;

    bool grows() const { return scenario::asks(plan.scenario.stop); }
};

/// Gyros that will be finished at the end; the maximum number if a stopping rule makes the lot grow.
std::int64_t gyros_of(const Task& task);

/// Prints a message about the run on standard error.
void say(const std::string& line);

/// A run with checkpoints: its folder, their writer, and its progress display.
class Session {
   public:
    Session(Task task, double every_s, parts::Beginning beginning);
    ~Session();
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    /// Does the work. If it fails, keeps the finished gyros, and the error says how many are kept and where.
    template <class Work>
    void keep_whatever_happens(Work&& work) {
        try {
            work();
        } catch (const Interrupted&) {
            const bool all = checkpoints_.keep_what_can_be();
            throw Interrupted(after("interrupted", all));
        } catch (const RunError& error) {
            fail(error.what());
        } catch (const InputError& error) {
            // A file that was there when the run began, as those of its checkpoints, cannot be read any more.
            fail(error.what());
        }
    }

    /// Removes the folder of a run whose result is written. Nothing is kept from here on: a checkpoint or a status
    /// that is written while the folder is emptied would stay behind.
    void remove_folder() {
        checkpoints_.end();
        folder_.remove();
    }

    std::int64_t all_gyros() const { return all_gyros_; }
    Task& task() { return task_; }
    const parts::Folder& folder() const { return folder_; }
    parts::Checkpoints& checkpoints() { return checkpoints_; }
    ensemble::Progress& progress() { return progress_; }
    ensemble::Monitor monitor() { return {interrupted, &progress_, task_.leader}; }

   private:
    parts::Checkpoints::Options options(double every_s) const;
    ensemble::ProgressOptions progress_options() const;
    std::string after(const std::string& what, bool all_kept) const;
    [[noreturn]] void fail(const std::string& what);

    Task task_;
    parts::Folder folder_;
    const std::int64_t all_gyros_;
    parts::Checkpoints checkpoints_;
    ensemble::Progress progress_;
};

}  // namespace ringlock::app
