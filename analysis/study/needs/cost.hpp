#pragma once
#include <cstdint>
#include <functional>

#include "analysis/study/experiment.hpp"

namespace ringlock::study {

/// Cost of simulating an experiment, estimated by a short trial.
struct Cost {
    std::int64_t turns = 0;    ///< of the whole experiment; with a stopping rule, at most
    double turns_per_s = 0.0;  ///< of all threads together
    double setup_s = 0.0;      ///< of a block of gyros, before its first turn; blocks of several threads side by side

    double blocks_in_turn = 0.0;  ///< that a thread simulates one after the other

    double wall_s() const { return blocks_in_turn * setup_s + static_cast<double>(turns) / turns_per_s; }
};

/// Simulates the first, the middle and the last point of the design for some `seconds` together, as many blocks side
/// by side as there are threads, and discards the results. Throws Interrupted where `cancelled` returns true, RunError
/// where the gyros cannot be simulated.
Cost measure_cost(const Experiment& experiment, int threads, double seconds, const std::function<bool()>& cancelled);

}  // namespace ringlock::study
