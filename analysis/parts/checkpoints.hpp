#pragma once
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "analysis/parts/folder.hpp"
#include "analysis/parts/part_files.hpp"
#include "analysis/parts/team.hpp"
#include "analysis/study/experiment.hpp"
#include "engine/ensemble/progress/progress.hpp"

namespace ringlock::parts {

/// Writes the finished blocks of a run into its folder. Each file is written under a temporary name, synced to the disk
/// and then renamed, so that a process that ends at any moment leaves complete files only.
///
/// Where the disk refuses a write, the run reports it and waits; finished blocks stay in memory until they can be
/// written. A folder that is gone ends the run after some seconds. Only the time since the start of the process is
/// used, so that the clock of the machine may be set.
class Checkpoints final : public study::Store {
   public:
    struct Options {
        double every_s = 30.0;            ///< 0: every block by itself
        std::optional<Shard> shard = {};  ///< the part of the run to simulate; empty: all of it
        std::int64_t of_gyros = 0;        ///< all gyros of the run, for the status file
        Leader* leader = nullptr;         ///< of the processes that simulate the run together; null: there is one
    };

    /// Reads the files of the folder. Damaged files are reported and put aside: their gyros are simulated again.
    Checkpoints(const Folder& folder, const study::Experiment& plan, Options options, Tell tell);
    /// Those of a member, which reads nothing and writes into the folder of the leader.
    Checkpoints(const std::filesystem::path& folder, const Manifest& manifest, const Member& member,
                const study::Experiment& plan, Options options, Tell tell);
    /// Ends the writing. Blocks that are not written by then are lost.
    ~Checkpoints() override;

    std::vector<study::Stretch> take_up(std::span<study::Study> points, std::int64_t first, std::int64_t last) override;
    std::unique_ptr<study::BlockKeeper> keeper(std::size_t point, std::int64_t first_gyro, std::size_t gyros) override;
    void collect(std::span<study::Study> points, std::int64_t first, std::int64_t last) override;
    double hours_before() const override { return seconds_before_ / 3600.0; }

    /// Starts the thread that writes finished blocks and, where a pace is given, the status file. Call it before the
    /// first block is simulated.
    void begin(std::function<ensemble::Progress::Pace()> pace);

    /// Ends that thread, and waits for it. Blocks that are not written by then stay in memory.
    void end() noexcept;

    /// The gyros that this process has to simulate, for an experiment that does not grow.
    std::vector<study::Stretch> to_do() const;

    /// Gyros that were finished before this process.
    std::int64_t gyros_before() const { return gyros_before_; }
    /// Gyros that are finished, whether kept yet or not.
    std::int64_t gyros() const;
    /// Blocks that this process has finished, and the mean time that one took a thread [s]; nothing before the first
    /// block.
    std::optional<double> mean_block_s() const;

    /// Keeps the finished blocks, or waits until the disk accepts them. Throws Interrupted.
    void keep_all();
    /// The same after an interruption or a failure: tries once. Returns whether all is kept now.
    bool keep_what_can_be() noexcept;

    /// The finished gyros. To be called after all of them are simulated, and after keep_all().
    const FinishedGyros& finished() const { return finished_; }

   private:
    class Keeper;
    /// A finished block that is not kept yet: by itself, or in a file of its own.
    struct Waiting {
        study::FinishedBlock block;  ///< without its gyros where a file has them
        std::int64_t gyros = 0;
        std::filesystem::path partial;
        std::filesystem::path file;
    };

    /// Those of the missing gyros that belong to this run: all, or those of its shard.
    std::vector<study::Stretch> of_shard(std::vector<study::Stretch> gaps) const;
    void take(Waiting waiting, double block_s);
    void keep_blocks(std::vector<Waiting>& blocks);
    void settle(const std::filesystem::path& partial, const std::filesystem::path& file);
    std::filesystem::path next_file();
    double wall_s() const;
    void wait_out(const std::string& problem, int error);
    void work(const std::stop_token& stop);
    void tell_status();

    const std::filesystem::path path_;
    const std::string who_;
    const std::string prefix_;  ///< of the names of files, so that no two processes choose the same
    const Manifest manifest_;
    const Options options_;
    const Tell tell_;
    const bool samples_;
    std::function<ensemble::Progress::Pace()> pace_;
    std::vector<std::int64_t> gyros_of_points_;
    FinishedGyros finished_;
    double seconds_before_ = 0.0;
    std::int64_t gyros_before_ = 0;
    const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();

    std::mutex keeping_;        ///< one writes at a time
    mutable std::mutex mutex_;  ///< guards the members below
    std::condition_variable_any wake_;
    std::vector<Waiting> waiting_;
    std::int64_t numbers_ = 0;
    std::int64_t blocks_ = 0;
    std::int64_t gyros_ = 0;
    double blocks_s_ = 0.0;
    std::string last_block_;
    std::atomic<bool> patient_ = true;
    std::optional<std::chrono::steady_clock::time_point> reported_;  ///< that the run waits
    std::optional<std::chrono::steady_clock::time_point> gone_;      ///< since when the folder is
    std::jthread worker_;                                            // last: it uses all of the above
};

}  // namespace ringlock::parts
