#include "engine/ensemble/schedule.hpp"

#include <algorithm>
#include <cmath>

#include "engine/scenario/read_arms.hpp"

namespace ringlock::ensemble {

Schedule::Schedule(const scenario::Scenario& scenario) {
    const double frequency = scenario.dither.frequency_hz;
    const double rate_hz = scenario::outputs_hz(scenario);
    output_s = 1.0 / rate_hz;
    outputs_per_sample = std::max<std::int64_t>(1, std::llround(scenario.output.sample_interval_s * rate_hz));
    settle_cycles = std::llround(scenario.ensemble.settle_s * frequency);
    sample_interval_s = static_cast<double>(outputs_per_sample) / rate_hz;
    // The small slack keeps a duration of whole samples from losing one to rounding.
    constexpr double slack = 1e-9;
    samples = 1 + static_cast<std::int64_t>(std::floor(scenario.ensemble.duration_s / sample_interval_s + slack));
    samples_per_fit = std::max<std::int64_t>(
        1, static_cast<std::int64_t>(std::ceil(scenario::least_fit_interval_s(scenario) / sample_interval_s - slack)));
    const scenario::StudyReader reader = scenario::study_reader(scenario);
    warm_up_outputs = reader.warm_up_outputs;
    delay_s = reader.delay_s;
    start_s = static_cast<double>(settle_cycles) * (1.0 / frequency) + static_cast<double>(warm_up_outputs) * output_s -
              delay_s;
    // Turns of a noisy drive come early or late, by far less than the cycle that is added for it.
    cycles_read = scenario::reads_arms(scenario)
                      ? 1 + static_cast<std::int64_t>(
                                std::ceil(static_cast<double>(warm_up_outputs + outputs() - 1) * output_s * frequency))
                      : outputs() - 1;
    // Progress and interruption are handled between pieces: pieces are shorter where each turn takes milliseconds.
    piece_turns = scenario.propagation.method == scenario::PropagationMethod::direct ? 8 : 128;
}

std::int64_t Schedule::piece_end(std::int64_t turn) const {
    return std::min(turn + piece_turns, turn < settle_turns() ? settle_turns() : turns());
}

std::int64_t outputs_in(const Schedule& schedule, double time_s) {
    return std::max<std::int64_t>(1, std::llround(time_s / schedule.output_s));
}

}  // namespace ringlock::ensemble
