#include "app/run/session.hpp"

#include <fmt/format.h>

#include <span>
#include <utility>
#include <vector>

#include "analysis/parts/shard.hpp"
#include "app/output.hpp"
#include "app/run/run_text.hpp"
#include "engine/core/printable.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::app {

namespace {

/// Turns that stretches of an experiment will count.
std::int64_t turns_of(const study::Experiment& plan, std::span<const study::Stretch> stretches) {
    std::int64_t turns = 0;
    for (const study::Stretch& stretch : stretches) {
        const study::Study& point = plan.points[stretch.study];
        const std::int64_t all = ensemble::expected_turns(point.scenario, point.scenario.arms);
        turns += all / static_cast<std::int64_t>(point.gyros.size()) * (stretch.last - stretch.first);
    }
    return turns;
}

std::int64_t gyros_of(std::span<const study::Stretch> stretches) {
    std::int64_t gyros = 0;
    for (const study::Stretch& stretch : stretches) gyros += stretch.last - stretch.first;
    return gyros;
}

}  // namespace

void say(const std::string& line) { tell(fmt::format("ringlock: {}\n", line)); }

std::int64_t gyros_of(const Task& task) {
    if (task.grows()) return task.plan.scenario.stop.most_gyros * static_cast<std::int64_t>(task.plan.points.size());
    if (!task.shard) return task.plan.gyros();
    std::vector<std::int64_t> gyros;
    for (const study::Study& point : task.plan.points) gyros.push_back(static_cast<std::int64_t>(point.gyros.size()));
    return gyros_of(parts::stretches_of(*task.shard, gyros));
}

Session::Session(Task task, double every_s, parts::Beginning beginning)
    : task_(std::move(task)),
      folder_(task_.target, parts::manifest_of(task_.plan.scenario, task_.shard), beginning, say),
      all_gyros_(gyros_of(task_)),
      checkpoints_(folder_, task_.plan, options(every_s), say),
      progress_(all_gyros_, progress_options()) {
    const std::int64_t before = checkpoints_.gyros_before();
    if (before > 0) say(fmt::format("resumed: {} of {} are finished", before, gyros_text(all_gyros_)));
    if (task_.leader) task_.leader->tell(&progress_);
    checkpoints_.begin([this] { return progress_.pace(); });
}

Session::~Session() {
    checkpoints_.end();  // its thread reads the progress, which is destroyed first
    if (task_.leader) task_.leader->tell(nullptr);
}

parts::Checkpoints::Options Session::options(double every_s) const {
    parts::Checkpoints::Options options;
    options.every_s = every_s;
    options.shard = task_.shard;
    options.of_gyros = all_gyros_;
    options.leader = task_.leader;
    return options;
}

ensemble::ProgressOptions Session::progress_options() const {
    ensemble::ProgressOptions options{.quiet = task_.quiet, .grows = task_.grows()};
    options.already_done.gyros = checkpoints_.gyros_before();
    if (task_.grows()) {
        options.total_turns = study::expected_turns(task_.plan);
        return options;
    }
    const std::vector<study::Stretch> to_do = checkpoints_.to_do();
    const std::int64_t turns = turns_of(task_.plan, to_do);
    const std::int64_t gyros = gyros_of(to_do);
    // Gyros that are finished count as many turns as the others. In a design they may belong to other points, but the
    // share that is shown need not be exact.
    if (gyros > 0) options.already_done.turns = turns / gyros * options.already_done.gyros;
    options.total_turns = turns + options.already_done.turns;
    return options;
}

void Session::fail(const std::string& what) {
    const bool all = checkpoints_.keep_what_can_be();
    throw RunError(checkpoints_.gyros() == 0 ? what : after(what, all));
}

std::string Session::after(const std::string& what, bool all_kept) const {
    const std::int64_t gyros = checkpoints_.gyros();
    std::string text = what;
    if (task_.leader) {
        return text + fmt::format(
                          "; the finished gyros of its {} processes are kept in {}: "
                          "the same command with --resume goes on from there",
                          1 + task_.leader->members(), printable(folder_.path()));
    }
    if (gyros == 0) {
        text += ", nothing written";
    } else if (all_kept) {
        text += fmt::format("; {} of {} are kept in {}: the same command with --resume goes on from there", gyros,
                            gyros_text(all_gyros_), printable(folder_.path()));
    } else {
        text += fmt::format("; {} could not all be kept in {}: --resume goes on from those that are there",
                            gyros_text(gyros), printable(folder_.path()));
    }
    if (const auto block_s = checkpoints_.mean_block_s()) {
        text += fmt::format("; a block of up to {} takes a thread about {}, and blocks under way are lost",
                            gyros_text(simd::lanes), duration_text(*block_s));
    }
    return text;
}

}  // namespace ringlock::app
