#include "analysis/study/cost.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <set>

#include "engine/core/error.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::study {

namespace {

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

struct Trial {
    std::int64_t turns = 0;
    double turning_s = 0.0;
    double setup_s = 0.0;
};

/// Takes no statistics: these are made of what the gyros do, and cost little beside it.
class Nothing final : public BlockKeeper {
   public:
    bool wants_samples() const override { return false; }
    void samples(const SampledAngles&) override {}
    void finish(const FinishedBlock&) override {}
};

Trial try_point(const scenario::Scenario& of, int threads, double seconds, const std::function<bool()>& cancelled) {
    Study study = [&] {
        scenario::Scenario enough = of;
        enough.stop = {};
        enough.output.angle_record = false;
        if (enough.input.sweep_points == 1) {
            enough.ensemble.gyros = static_cast<std::int64_t>(threads) * static_cast<std::int64_t>(simd::lanes);
        }
        return Study(enough);
    }();
    const Clock::time_point start = Clock::now();
    std::atomic<double> first_turn_s = -1.0;
    std::atomic<std::int64_t> turns = 0;
    const auto enough = [&] {
        const double begun_s = first_turn_s;
        return begun_s >= 0.0 && since(start) - begun_s >= seconds;
    };
    const ensemble::Monitor monitor{[&] { return cancelled() || enough(); },
                                    [&](std::int64_t, std::int64_t more) {
                                        double none = -1.0;
                                        // The first piece of turns is set-up as well: caches are cold.
                                        if (first_turn_s.compare_exchange_strong(none, since(start))) return;
                                        turns += more;
                                    }};
    const Stretch all{0, 0,
                      std::min<std::int64_t>(ensemble::total_gyros(study.scenario),
                                             static_cast<std::int64_t>(threads) * simd::lanes)};
    try {
        run(
            {&study, 1}, {&all, 1}, threads,
            [](std::size_t, std::int64_t, std::size_t) { return std::make_unique<Nothing>(); }, monitor);
    } catch (const Interrupted&) {
        if (cancelled()) throw;
    }
    const double begun_s = std::max(0.0, first_turn_s.load());
    return {turns, since(start) - begun_s, begun_s};
}

}  // namespace

Cost measure_cost(const Experiment& experiment, int threads, double seconds, const std::function<bool()>& cancelled) {
    const std::size_t points = experiment.points.size();
    const std::set<std::size_t> tried = {0, points / 2, points - 1};
    Trial all;
    for (const std::size_t point : tried) {
        const Trial one = try_point(experiment.points[point].scenario, threads,
                                    seconds / static_cast<double>(tried.size()), cancelled);
        all.turns += one.turns;
        all.turning_s += one.turning_s;
        all.setup_s += one.setup_s;
    }
    Cost cost;
    cost.turns = expected_turns(experiment);
    cost.turns_per_s = std::max(1.0, static_cast<double>(all.turns)) / std::max(1e-9, all.turning_s);
    cost.setup_s = all.setup_s / static_cast<double>(tried.size());
    const double blocks = static_cast<double>(experiment.gyros()) / static_cast<double>(simd::lanes);
    cost.blocks_in_turn = std::max(1.0, blocks / static_cast<double>(threads));
    return cost;
}

}  // namespace ringlock::study
