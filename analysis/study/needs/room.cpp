#include "analysis/study/needs/room.hpp"

#include <algorithm>
#include <vector>

#include "analysis/study/design_points.hpp"
#include "analysis/study/experiment.hpp"
#include "analysis/study/result/result_file.hpp"
#include "analysis/study/study.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/reader/latch.hpp"
#include "engine/scenario/read_arms.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::study {
namespace {

/// The program with its libraries and a thread pool.
constexpr std::uint64_t memory_of_program = 40'000'000;
/// Memory of one thread for an arm while it simulates a block [bytes]: sums at all octaves and at most fit_samples
/// rows.
constexpr std::uint64_t memory_of_block = 2'000'000;

/// Memory of one thread for the readers of a block [bytes]: for each trajectory the instants of a piece, for which a
/// vector may have reserved twice the room, and for all arms the filters, taps and angles.
std::uint64_t memory_of_readers(const scenario::Scenario& scenario) {
    if (!scenario::reads_arms(scenario)) return 0;
    constexpr double trajectories = 3.0;  // at most
    constexpr double real = sizeof(double);
    const scenario::StudyReader reader = scenario::study_reader(scenario);
    const ensemble::Schedule schedule(scenario);
    const double piece_s = 0.5 * static_cast<double>(schedule.piece_turns) / scenario.dither.frequency_hz;
    const double instants = 2.0 * trajectories * sizeof(reader::Instant) * reader.latch_hz * piece_s;
    const double filters = 2.0 * real * 2.0 * reader.delay_s * reader.latch_hz;
    const double outputs = 2.0 * real * scenario.reader.output_hz * piece_s;
    const auto arms = static_cast<double>(scenario.arms.size());
    return static_cast<std::uint64_t>(simd::lanes * (instants + arms * (filters + outputs)));
}

/// Gyros of a point and a rate of the sweep, at most.
std::uint64_t gyros_at_most(const scenario::Scenario& scenario) {
    const bool grows = scenario::asks(scenario.stop);
    return static_cast<std::uint64_t>(grows ? scenario.stop.most_gyros : scenario.ensemble.gyros);
}

/// The scenario with so many gyros, which never grow.
scenario::Scenario with_gyros(scenario::Scenario scenario, std::int64_t gyros) {
    scenario.ensemble.gyros = gyros;
    scenario.ensemble.turn_ons = 1;
    scenario.stop = {};
    return scenario;
}

}  // namespace

std::uint64_t expected_memory_bytes(const scenario::Scenario& scenario, int threads) {
    const std::vector<Axis> axes = design_axes(scenario);
    const std::uint64_t points = axes.empty() ? 1 : axes.front().values.size();
    const std::uint64_t gyros = gyros_at_most(scenario) * static_cast<std::uint64_t>(scenario.input.sweep_points);
    scenario::Scenario alone = with_gyros(scenario, 1);
    alone.design = {};
    // The summary of a point copies the curves of one arm at a time.
    const std::uint64_t of_summary = gyros * Study(alone).factors.size() * sizeof(allan::Point);
    // A block has half of its lanes filled at least.
    const std::uint64_t blocks = points * (gyros / (simd::lanes / 2) + 1);
    const std::uint64_t at_once = std::min(static_cast<std::uint64_t>(threads), blocks);
    return memory_of_program + points * expected_memory_bytes(scenario) +
           at_once * (scenario.arms.size() * memory_of_block + memory_of_readers(scenario)) +
           std::min(points, at_once) * of_summary;
}

std::uint64_t expected_disk_bytes(const scenario::Scenario& scenario) {
    const std::vector<Axis> axes = design_axes(scenario);
    // A result is a part of its own and one for each gyro.
    const std::uint64_t of_one = expected_size_bytes(Experiment(with_gyros(scenario, 1), axes));
    const std::uint64_t of_two = expected_size_bytes(Experiment(with_gyros(scenario, 2), axes));
    return of_one + (gyros_at_most(scenario) - 1) * (of_two - of_one);
}

}  // namespace ringlock::study
