#pragma once
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include <cstddef>
#include <utility>

namespace ringlock::ensemble {

/// Calls `work` where loops of oneTBB use that many threads. An arena alone gets no more workers than there are cores;
/// asked for more threads, this gives more.
template <class Work>
void on_threads(int threads, Work&& work) {
    const oneapi::tbb::global_control control(oneapi::tbb::global_control::max_allowed_parallelism,
                                              static_cast<std::size_t>(threads));
    oneapi::tbb::task_arena arena(threads);
    arena.execute(std::forward<Work>(work));
}

}  // namespace ringlock::ensemble
