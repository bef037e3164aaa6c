#include "engine/ensemble/schedule.hpp"

#include <algorithm>
#include <cmath>

namespace ringlock::ensemble {

Schedule::Schedule(const scenario::Scenario& scenario) {
    const double frequency = scenario.dither.frequency_hz;
    output_s = 1.0 / frequency;
    outputs_per_sample = std::max<std::int64_t>(1, std::llround(scenario.output.sample_interval_s * frequency));
    settle_cycles = std::llround(scenario.ensemble.settle_s * frequency);
    sample_interval_s = static_cast<double>(outputs_per_sample) / frequency;
    // The small slack keeps a duration of whole samples from losing one to rounding.
    samples = 1 + static_cast<std::int64_t>(std::floor(scenario.ensemble.duration_s / sample_interval_s + 1e-9));
    // Whoever follows a run looks at it between pieces: they are shorter where each turn takes milliseconds.
    piece_turns = scenario.propagation.method == scenario::PropagationMethod::direct ? 8 : 128;
}

std::int64_t Schedule::piece_end(std::int64_t turn) const {
    return std::min(turn + piece_turns, turn < settle_turns() ? settle_turns() : turns());
}

std::int64_t outputs_in(const Schedule& schedule, double time_s) {
    return std::max<std::int64_t>(1, std::llround(time_s / schedule.output_s));
}

}  // namespace ringlock::ensemble
