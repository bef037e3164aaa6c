#include "engine/scenario/read_arms.hpp"

#include <algorithm>

#include "engine/reader/stripper.hpp"

namespace ringlock::scenario {

bool reads_arms(const Scenario& s) { return s.reader.output_hz > 0.0; }

double outputs_hz(const Scenario& s) { return reads_arms(s) ? s.reader.output_hz : s.dither.frequency_hz; }

StudyReader study_reader(const Scenario& s) {
    if (!reads_arms(s)) return {};
    const double latch_hz = reader::latch_hz(s.reader, s.reader.output_hz);
    const auto stripper = reader::make_stripper(s.reader, latch_hz, s.dither.frequency_hz);
    return {latch_hz, stripper->delay_s(), stripper->residue_relative(),
            reader::warm_up_outputs(*stripper, s.reader.output_hz)};
}

double simulated_s(const Scenario& s) {
    const double without_warm_up_s = s.ensemble.settle_s + s.ensemble.duration_s;
    if (!reads_arms(s)) return without_warm_up_s;
    return without_warm_up_s + static_cast<double>(study_reader(s).warm_up_outputs) / s.reader.output_hz;
}

double least_fit_interval_s(const Scenario& s) {
    if (!reads_arms(s)) return 0.0;
    constexpr double lengths = 10.0;
    return std::max(1.0 / s.dither.frequency_hz, lengths * 2.0 * study_reader(s).delay_s);
}

}  // namespace ringlock::scenario
