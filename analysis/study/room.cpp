#include "analysis/study/room.hpp"

#include <algorithm>
#include <vector>

#include "analysis/study/design_points.hpp"
#include "analysis/study/experiment.hpp"
#include "analysis/study/result_file.hpp"
#include "analysis/study/result_layout.hpp"
#include "analysis/study/study.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::study {
namespace {

/// The program with its libraries and a thread pool.
constexpr std::uint64_t memory_of_program = 40'000'000;
/// What one thread holds of an arm while it simulates a block: sums at all octaves and at most fit_samples rows.
constexpr std::uint64_t memory_of_block = 2'000'000;

/// The scenario with so many gyros, which never grow.
scenario::Scenario with_gyros(scenario::Scenario scenario, std::int64_t gyros) {
    scenario.ensemble.gyros = gyros;
    scenario.ensemble.turn_ons = 1;
    scenario.stop = {};
    return scenario;
}

}  // namespace

Room expected_room(const scenario::Scenario& scenario, int threads) {
    const std::vector<Axis> axes = design_axes(scenario);
    const std::uint64_t points = axes.empty() ? 1 : axes.front().values.size();
    const auto gyros =
        static_cast<std::uint64_t>(scenario::asks(scenario.stop) ? scenario.stop.most_gyros : scenario.ensemble.gyros);
    const std::uint64_t gyros_of_a_point = gyros * static_cast<std::uint64_t>(scenario.input.sweep_points);
    const Experiment one(with_gyros(scenario, 1), axes);
    // The summary of a point copies the curves of one arm at a time, and has some figures of every gyro side by side.
    constexpr std::uint64_t of_figures = 640;
    const std::uint64_t of_summary = gyros_of_a_point * (layout::most_taus(one) * sizeof(allan::Point) + of_figures);
    // A block has half of its lanes filled at least.
    const std::uint64_t blocks = points * (gyros_of_a_point / (simd::lanes / 2) + 1);
    const std::uint64_t at_once = std::min(static_cast<std::uint64_t>(threads), blocks);
    Room room;
    room.memory_bytes = memory_of_program + points * expected_memory_bytes(scenario) +
                        at_once * scenario.arms.size() * memory_of_block + std::min(points, at_once) * of_summary;
    // A result is a part of its own and one for each gyro.
    const std::uint64_t of_one = expected_size_bytes(one);
    const std::uint64_t of_two = expected_size_bytes(Experiment(with_gyros(scenario, 2), axes));
    room.disk_bytes = of_one + (gyros - 1) * (of_two - of_one);
    return room;
}

}  // namespace ringlock::study
