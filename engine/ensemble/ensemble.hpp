#pragma once
#include <cstdint>
#include <functional>
#include <span>

#include "engine/ensemble/gyro_run.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::ensemble {

/// Called once for each gyro when it is done, from any thread, several at a time and in any order.
using Sink = std::function<void(std::int64_t gyro, GyroRecord&& record)>;

/// Simulates gyros [first, last) of the scenario on `threads` threads of oneTBB.
///
/// What a gyro does depends on its number, never on the thread: results are the same for any number of threads. Gyros
/// that fail do not stop the others; their failures are reported together in one RunError at the end. Cancellation
/// stops all and throws Interrupted.
void run(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t first, std::int64_t last,
         int threads, const Sink& sink, const Monitor& monitor);

}  // namespace ringlock::ensemble
