#include "engine/scenario/read_arms.hpp"

#include <algorithm>
#include <memory>

#include "engine/reader/stripper.hpp"

namespace ringlock::scenario {

bool reads_arms(const Scenario& s) { return s.reader.output_hz > 0.0; }

double outputs_hz(const Scenario& s) { return reads_arms(s) ? s.reader.output_hz : s.dither.frequency_hz; }

namespace {

double latch_hz(const Scenario& s) { return reader::latch_hz(s.reader, s.reader.output_hz); }

std::unique_ptr<reader::Stripper> stripper_of(const Scenario& s) {
    return reader::make_stripper(s.reader, latch_hz(s), s.dither.frequency_hz);
}

}  // namespace

StudyReader study_reader(const Scenario& s) {
    if (!reads_arms(s)) return {};
    const auto stripper = stripper_of(s);
    return {latch_hz(s), stripper->delay_s(), reader::warm_up_outputs(*stripper, s.reader.output_hz)};
}

double reader_residue_relative(const Scenario& s) { return reads_arms(s) ? stripper_of(s)->residue_relative() : 0.0; }

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
