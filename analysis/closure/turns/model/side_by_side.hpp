#pragma once
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "analysis/closure/options.hpp"
#include "engine/core/interrupt.hpp"

namespace ringlock::closure {

/// Calls `work` for each of 0, 1, ..., count - 1, on all available threads, and ends early if the program is
/// interrupted.
///
/// A thread that waits for the others at the end takes no other work meanwhile. In a nested loop it would otherwise
/// begin another iteration of the outer loop, and both iterations would hold their memory: for each thread as many fits
/// of a long record as there are nested loops.
template <typename Index, typename Work>
void side_by_side(Index count, Work&& work) {
    oneapi::tbb::this_task_arena::isolate([&] {
        oneapi::tbb::parallel_for(Index{0}, count, [&](Index k) {
            check_interrupt();
            work(k);
        });
    });
}

/// Calls `work` with a limit on the threads, so that their memory for a record of that number of turns is bounded.
template <typename Work>
auto on_threads_for(std::size_t turns, Work&& work) {
    const TurnOptions::Effort& of = options.turns.effort;
    const int cores = oneapi::tbb::this_task_arena::max_concurrency();
    const double most = of.turns_of_all_threads / static_cast<double>(std::max<std::size_t>(turns, 1));
    const int threads = most < cores ? std::max(static_cast<int>(most), std::min(cores, of.fewest_threads)) : cores;
    oneapi::tbb::task_arena arena(threads);
    return arena.execute(std::forward<Work>(work));
}

}  // namespace ringlock::closure
