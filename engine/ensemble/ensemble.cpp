#include "engine/ensemble/ensemble.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/error.hpp"

namespace ringlock::ensemble {

namespace {

constexpr std::size_t most_failures_named = 10;

/// Failures of single gyros, collected so that one bad gyro of a thousand does not hide the others.
class Failures {
   public:
    void add(std::int64_t gyro, const std::string& why) {
        const std::lock_guard lock(mutex_);
        failures_.emplace_back(gyro, why);
    }
    void report(std::int64_t gyros) {
        if (failures_.empty()) return;
        std::sort(failures_.begin(), failures_.end());
        std::string text = fmt::format("{} of {} gyros could not be simulated", failures_.size(), gyros);
        for (std::size_t i = 0; i < std::min(failures_.size(), most_failures_named); ++i) {
            text += fmt::format("\n  gyro {}: {}", failures_[i].first, failures_[i].second);
        }
        if (failures_.size() > most_failures_named) text += "\n  ...";
        throw RunError(text);
    }

   private:
    std::mutex mutex_;
    std::vector<std::pair<std::int64_t, std::string>> failures_;
};

}  // namespace

void run(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t first, std::int64_t last,
         int threads, const Sink& sink, const Monitor& monitor) {
    // An arena alone gets no more workers than there are cores; asked for more threads, give more.
    const oneapi::tbb::global_control control(oneapi::tbb::global_control::max_allowed_parallelism,
                                              static_cast<std::size_t>(threads));
    oneapi::tbb::task_arena arena(threads);
    Failures failures;
    arena.execute([&] {
        // Its own context: cancelling this loop must not cancel a loop of the caller around it.
        oneapi::tbb::task_group_context context(oneapi::tbb::task_group_context::isolated);
        oneapi::tbb::parallel_for(
            oneapi::tbb::blocked_range<std::int64_t>(first, last, 1),
            [&](const oneapi::tbb::blocked_range<std::int64_t>& block) {
                for (std::int64_t gyro = block.begin(); gyro != block.end(); ++gyro) {
                    GyroRecord record;
                    try {
                        record = simulate_gyro(scenario, arms, gyro, monitor);
                    } catch (const RunError& error) {
                        failures.add(gyro, error.what());
                        continue;
                    }
                    sink(gyro, std::move(record));
                }
            },
            oneapi::tbb::simple_partitioner(), context);
    });
    failures.report(last - first);
}

}  // namespace ringlock::ensemble
