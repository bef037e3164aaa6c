#include "engine/ensemble/ensemble.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_group.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/ensemble/arena.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/read_outputs.hpp"
#include "engine/ensemble/trajectory_kind.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::ensemble {

namespace {

constexpr std::size_t most_failures_named = 10;

/// Failures of single gyros, collected so that one bad gyro of a thousand does not hide the others.
class Failures {
   public:
    void add(std::size_t job, std::int64_t gyro, const std::string& why) {
        const std::lock_guard lock(mutex_);
        failures_.push_back({job, gyro, why});
    }
    void report(std::span<const Job> jobs, std::int64_t gyros) {
        if (failures_.empty()) return;
        std::sort(failures_.begin(), failures_.end());
        std::string text = fmt::format("{} of {} gyros could not be simulated", failures_.size(), gyros);
        for (std::size_t i = 0; i < std::min(failures_.size(), most_failures_named); ++i) {
            const auto& [job, gyro, why] = failures_[i];
            const std::string& name = jobs[job].name;
            text += fmt::format("\n  {}gyro {}: {}", name.empty() ? "" : name + ", ", gyro, why);
        }
        if (failures_.size() > most_failures_named) text += "\n  ...";
        throw RunError(text);
    }

   private:
    std::mutex mutex_;
    std::vector<std::tuple<std::size_t, std::int64_t, std::string>> failures_;
};

/// Gyros that are simulated side by side.
struct Block {
    std::size_t job;
    std::int64_t first;
    std::int64_t gyros;
};

/// A trajectory that cannot be followed: a failure of that gyro, where one of a sink (a disk that is full) is the
/// run's.
struct TrajectoryFailure {
    std::string why;
};

template <class Step>
auto follow(Step&& step) {
    try {
        return step();
    } catch (const RunError& error) {
        throw TrajectoryFailure{error.what()};
    }
}

/// Gyros of a block: full ones where that leaves work for every thread, to the end as well.
std::int64_t block_size(std::int64_t gyros, int threads) {
    constexpr std::int64_t blocks_per_thread = 2;
    const std::int64_t full = simd::lanes;
    const std::int64_t share = (gyros + blocks_per_thread * threads - 1) / (blocks_per_thread * threads);
    // Half a block is one vector of AVX-512; a smaller one would run with empty lanes.
    return share >= full ? full : std::min<std::int64_t>(gyros, std::max<std::int64_t>(share, full / 2));
}

/// Takes the blocks of several jobs in another order, in which any few of them stand for all: points of a design that
/// take longer and longer would else make every guess of the time left too short. The step from one block to the next
/// is the golden section of their number, or nearly, as no block may be met twice.
std::vector<Block> spread(const std::vector<Block>& blocks) {
    const std::size_t count = blocks.size();
    auto step = static_cast<std::size_t>(std::llround(static_cast<double>(count) * (std::numbers::phi - 1.0)));
    while (std::gcd(step, count) > 1) ++step;
    std::vector<Block> order;
    for (std::size_t i = 0, at = 0; i < count; ++i, at = (at + step) % count) order.push_back(blocks[at]);
    return order;
}

/// Reports the progress of a block to the monitor. Where the block fails and its gyros go through the same turns again
/// one by one, no turn and no stage is reported twice.
class BlockProgress {
   public:
    BlockProgress(const Monitor& monitor, std::size_t block) : monitor_(monitor), block_(block) { tell(); }

    void enter(BlockStage stage) {
        // Of gyros one by one only that all are over is news.
        if (stage <= stage_ || (again_ && stage == BlockStage::output)) return;
        stage_ = stage;
        tell();
    }
    void begin_again() {
        again_ = true;
        already_ += reported_;
        reported_ = 0;
    }
    void advance(std::int64_t gyros, std::int64_t turns, bool tabulated) {
        const std::int64_t again = std::min(already_, turns);
        already_ -= again;
        reported_ += turns - again;
        if (monitor_.observer && (gyros > 0 || turns > again)) {
            monitor_.observer->advance(block_, gyros, turns - again, tabulated);
        }
    }
    bool cancelled() const { return monitor_.cancelled && monitor_.cancelled(); }

   private:
    void tell() const {
        if (monitor_.observer) monitor_.observer->enter(block_, stage_);
    }

    const Monitor& monitor_;
    std::size_t block_;
    BlockStage stage_ = BlockStage::set_up;
    bool again_ = false;
    std::int64_t reported_ = 0;  ///< since the last beginning
    std::int64_t already_ = 0;   ///< reported before it and not gone through again so far
};

void simulate(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t first,
              std::size_t gyros, BlockSink& sink, BlockProgress& progress) {
    const Schedule schedule(scenario);
    std::optional<ReaderPlan> plan;
    std::optional<ReadOutputs> read;
    if (scenario::reads_arms(scenario)) {
        plan = {scenario.reader.output_hz, schedule.settle_turns()};
        read.emplace(schedule, arms.size(), gyros);
    }
    GyroBlock block = follow([&] { return GyroBlock(scenario, arms, first, gyros, Detail::output, plan); });
    const std::int64_t counted = static_cast<std::int64_t>(gyros) * block.trajectories();
    progress.enter(BlockStage::turns);
    std::int64_t tables = 0;
    for (std::int64_t turn = 0; turn < schedule.turns();) {
        if (progress.cancelled()) throw Interrupted();
        const bool settling = turn < schedule.settle_turns();
        const auto turns = static_cast<std::size_t>(schedule.piece_end(turn) - turn);
        follow([&] { block.advance(turns); });
        if (read) read->take(block);
        for (std::size_t arm = 0; arm < arms.size() && !settling; ++arm) {
            sink.angles(arm, read ? read->rows(arm) : block.counts(arm));
        }
        turn += static_cast<std::int64_t>(turns);
        progress.advance(0, static_cast<std::int64_t>(turns) * counted, block.tables_made() > tables);
        tables = block.tables_made();
    }
    if (read && !read->complete()) {
        throw TrajectoryFailure{
            "the turns of its dither are more than a cycle early, so that its reader has too few outputs; "
            "inject less noise"};
    }
    progress.enter(BlockStage::output);
    sink.finish({first, block.setups(), counted * schedule.turns(), block.tables_remade(),
                 block.contradictory_readings(), block.change_per_cycle_rad(), block.table_error_rad()});
    progress.advance(static_cast<std::int64_t>(gyros), 0, false);
}

/// Turns that one gyro will count.
std::int64_t turns_of_gyro(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms) {
    std::int64_t trajectories = 0;
    for (const TrajectoryKind kind : {TrajectoryKind::plain, TrajectoryKind::noise_injected}) {
        const auto is = [&](const scenario::Arm& arm) { return kind_of(arm) == kind; };
        trajectories += std::any_of(arms.begin(), arms.end(), is) ? 1 : 0;
    }
    return trajectories * Schedule(scenario).turns();
}

/// The blocks of a simulation that no other process shares, one after the other.
class OwnBlocks final : public BlockSource {
   public:
    explicit OwnBlocks(int threads) : threads_(threads) {}
    int threads() const override { return threads_; }
    void begin(std::size_t blocks) override { blocks_ = blocks; }
    std::optional<std::size_t> next() override {
        const std::size_t block = next_++;
        return block < blocks_ ? std::optional(block) : std::nullopt;
    }

   private:
    int threads_;
    std::size_t blocks_ = 0;
    std::atomic<std::size_t> next_ = 0;
};

void tell_plan(std::span<const Job> jobs, std::span<const Block> blocks, int threads, const Monitor& monitor) {
    if (!monitor.observer) return;
    std::vector<std::int64_t> turns;
    for (const Job& job : jobs) turns.push_back(turns_of_gyro(*job.scenario, job.arms));
    std::vector<PlannedBlock> planned;
    for (const Block& block : blocks) planned.push_back({block.gyros, block.gyros * turns[block.job]});
    monitor.observer->plan(planned, threads);
}

}  // namespace

std::int64_t expected_turns(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms) {
    return total_gyros(scenario) * turns_of_gyro(scenario, arms);
}

void run(std::span<const Job> jobs, int threads, const Monitor& monitor) {
    std::int64_t all = 0;
    for (const Job& job : jobs) all += job.last - job.first;
    if (all == 0) return;
    OwnBlocks own(threads);
    BlockSource& source = monitor.blocks ? *monitor.blocks : own;
    std::vector<Block> blocks;
    const std::int64_t size = block_size(all, source.threads());
    for (std::size_t job = 0; job < jobs.size(); ++job) {
        for (std::int64_t gyro = jobs[job].first; gyro < jobs[job].last; gyro += size) {
            blocks.push_back({job, gyro, std::min(size, jobs[job].last - gyro)});
        }
    }
    if (jobs.size() > 1) blocks = spread(blocks);
    tell_plan(jobs, blocks, source.threads(), monitor);
    source.begin(blocks.size());
    Failures failures;
    const auto simulate_gyros = [&](const Job& job, std::int64_t gyro, std::int64_t gyros, BlockProgress& progress) {
        const auto sink = job.make_sink(gyro, static_cast<std::size_t>(gyros));
        simulate(*job.scenario, job.arms, gyro, static_cast<std::size_t>(gyros), *sink, progress);
    };
    const auto simulate_block = [&](std::size_t number) {
        const Block& block = blocks[number];
        const Job& job = jobs[block.job];
        BlockProgress progress(monitor, number);
        try {
            simulate_gyros(job, block.first, block.gyros, progress);
        } catch (const TrajectoryFailure& together) {
            progress.begin_again();
            // Which ones? Those of the block that can be simulated are so by themselves.
            for (std::int64_t one = block.first; one < block.first + block.gyros; ++one) {
                try {
                    if (block.gyros == 1) throw together;
                    simulate_gyros(job, one, 1, progress);
                } catch (const TrajectoryFailure& failure) {
                    failures.add(block.job, one, failure.why);
                }
            }
        }
        progress.enter(BlockStage::over);
    };
    std::atomic<bool> stopped = false;
    const auto simulate_blocks = [&](int) {
        try {
            while (!stopped) {
                const std::optional<std::size_t> block = source.next();
                if (!block) return;
                simulate_block(*block);
            }
        } catch (...) {
            stopped = true;
            throw;
        }
    };
    on_threads(threads, [&] {
        // Its own context: cancelling this loop must not cancel a loop of the caller around it.
        oneapi::tbb::task_group_context context(oneapi::tbb::task_group_context::isolated);
        oneapi::tbb::parallel_for(0, threads, simulate_blocks, oneapi::tbb::simple_partitioner(), context);
    });
    failures.report(jobs, all);
}

}  // namespace ringlock::ensemble
