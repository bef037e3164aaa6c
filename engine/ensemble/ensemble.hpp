#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/ensemble/block_source.hpp"
#include "engine/ensemble/progress/observer.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/scenario.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::ensemble {

/// Data of a block of gyros in addition to its output.
struct BlockResult {
    std::int64_t first_gyro = 0;
    std::vector<gyro::Setup> setups;  ///< of each gyro, as drawn
    std::int64_t turns = 0;           ///< zero-rate points of the trajectories simulated, without that of `ideal`
    std::int64_t tables_remade = 0;   ///< turn maps made anew because the drive left their ranges
    std::int64_t contradictory_readings = 0;  ///< turns at which pulses and detectors contradicted each other
    /// Rms change of each gyro's amplitude from a turn to the next but one [rad]; empty without injected noise.
    std::vector<double> change_per_cycle_rad;
    double turn_map_error_rad = 0.0;  ///< largest interpolation error measured when the tables were made; 0: no tables
};

/// Takes the output of one block of consecutive gyros while it is simulated. Memory for all of it is not held by the
/// engine.
class BlockSink {
   public:
    virtual ~BlockSink() = default;
    /// The next outputs of an arm (schedule.hpp), from the first of the record on: [output][gyro] in counts of
    /// 1/counts_per_fringe fringes that wrap round (output_counts.hpp).
    virtual void angles(std::size_t arm, std::span<const simd::LaneCounts> counts) = 0;
    /// The block is done.
    virtual void finish(const BlockResult& result) = 0;
};

/// Makes the sink of a block; called from the thread that simulates it.
using SinkFactory = std::function<std::unique_ptr<BlockSink>(std::int64_t first_gyro, std::size_t gyros)>;

/// Callbacks of a simulation while it runs. All may be empty, are called from any thread, and outlive the simulation.
struct Monitor {
    std::function<bool()> cancelled = {};  ///< true stops the simulation with Interrupted
    Observer* observer = nullptr;
    BlockSource* blocks = nullptr;  ///< where other processes simulate the same jobs: which blocks this one takes
};

/// Turns that the whole ensemble will count. A scenario without complaints (scenario/check.hpp) has no more than a
/// 64-bit number can hold.
std::int64_t expected_turns(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms);

/// Gyros [first, last) of one scenario, and where their output goes.
struct Job {
    const scenario::Scenario* scenario;  ///< outlives the run, as the arms do
    std::span<const scenario::Arm> arms;
    std::int64_t first;
    std::int64_t last;
    SinkFactory make_sink;
    std::string name = {};  ///< of the scenario among several, for messages of failures; empty if there is only one
};

/// Simulates the gyros of all jobs on `threads` threads of oneTBB, in blocks of at most simd::lanes, none of two jobs.
///
/// The results of a gyro depend on its scenario and number, never on block, thread or other jobs: results are the same
/// for any number of threads and of processes that share the blocks (Monitor::blocks). Gyros that fail do not stop the
/// others; their failures are reported together in one RunError at the end. An exception of a sink stops all and is
/// passed on; cancellation stops all and throws Interrupted.
void run(std::span<const Job> jobs, int threads, const Monitor& monitor);

}  // namespace ringlock::ensemble
