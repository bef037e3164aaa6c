#include "analysis/study/needs/cost.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <span>
#include <string>

#include "engine/core/error.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/progress/observer.hpp"
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

/// Counts turns from when the first block begins to go through them.
class TrialObserver final : public ensemble::Observer {
   public:
    void stage(const std::string&) override {}
    void plan(std::span<const ensemble::PlannedBlock>, int) override {}
    void enter(std::size_t, ensemble::BlockStage stage) override {
        double none = -1.0;
        if (stage == ensemble::BlockStage::turns) setup_s_.compare_exchange_strong(none, since(start_));
    }
    void advance(std::size_t, std::int64_t, std::int64_t turns, bool) override { turns_ += turns; }

    std::int64_t turns() const { return turns_; }
    double setup_s() const { return std::max(0.0, setup_s_.load()); }
    double turning_s() const { return setup_s_ < 0.0 ? 0.0 : since(start_) - setup_s_; }

   private:
    Clock::time_point start_ = Clock::now();
    std::atomic<double> setup_s_ = -1.0;
    std::atomic<std::int64_t> turns_ = 0;
};

/// Takes no statistics: their cost is small against that of the simulation.
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
    TrialObserver observer;
    const ensemble::Monitor monitor{[&] { return cancelled() || observer.turning_s() >= seconds; }, &observer};
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
    return {observer.turns(), observer.turning_s(), observer.setup_s()};
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
