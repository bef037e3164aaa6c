#pragma once
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include <cstddef>
#include <utility>

namespace ringlock::ensemble {

/// Calls `work` where loops of oneTBB use that many threads. An arena alone gets no more workers than there are cores;
/// this function provides more threads if more are requested.
template <class Work>
void on_threads(int threads, Work&& work) {
    const oneapi::tbb::global_control control(oneapi::tbb::global_control::max_allowed_parallelism,
                                              static_cast<std::size_t>(threads));
    oneapi::tbb::task_arena arena(threads);
    arena.execute(std::forward<Work>(work));
}

}  // namespace ringlock::ensemble
