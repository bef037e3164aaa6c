#include <fmt/format.h>

#include <array>
#include <cmath>
#include <span>

#include "engine/core/units.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

bool takes_samples(const Scenario& s) { return s.record.kind == RecordKind::samples; }

struct Output {
    double hz;
    std::string key;
};

/// Rate at which the reader puts out angles, which effects on the samples may change, and the key that sets it.
Output reader_output(const Scenario& s) {
    Output output{s.record.rate_hz, "record.rate_hz"};
    for (const auto& [effect, values] : active_effects(s)) {
        const auto stage = effect->sample_stage(*values, {});
        if (!stage) continue;
        const double needed_hz = stage->source_hz(output.hz);
        if (needed_hz == output.hz) continue;
        const effects::Parameter* rate = effects::first_of(*effect, effects::Role::sampled);
        output = {needed_hz, fmt::format("effects.{}.{}", effect->name(), rate->name)};
    }
    return output;
}

double latch_hz(const Scenario& s) { return s.reader.latch_hz > 0.0 ? s.reader.latch_hz : reader_output(s).hz; }

bool strips_with(const Scenario& s, reader::Stripping one, reader::Stripping other) {
    return takes_samples(s) && (s.reader.stripping == one || s.reader.stripping == other);
}

Finding turns_are_not_compensated(const Scenario& s) {
    if (takes_samples(s) || s.record.trajectory.compensator == Compensator::none) return {};
    return Complaint{{"record.trajectory", "record.kind"},
                     "a record of turns holds what the electronics see of them, before any compensation; record an arm "
                     "without compensator, or samples"};
}

Finding ticks_make_samples(const Scenario& s) {
    if (!takes_samples(s) || s.reader.latch_hz == 0.0) return {};
    const Output output = reader_output(s);
    const double ratio = s.reader.latch_hz / output.hz;
    if (ratio > 0.5 && std::abs(ratio - std::round(ratio)) < 1e-9 * ratio) return {};
    return Complaint{{"reader.latch_hz", output.key},
                     fmt::format("{:g} Hz are not a whole multiple of the {:g} Hz at which samples are taken",
                                 s.reader.latch_hz, output.hz)};
}

Finding filter_fits(const Scenario& s) {
    if (!strips_with(s, reader::Stripping::fir, reader::Stripping::reference_fir)) return {};
    if (s.reader.fir_order % 2 != 0) {
        return Complaint{{"reader.fir_order"}, "an odd order would delay by half a tick; use an even one"};
    }
    const double cutoff_hz = s.reader.fir_cutoff_hz > 0.0 ? s.reader.fir_cutoff_hz : 0.25 * s.dither.frequency_hz;
    const double latched_hz = latch_hz(s);
    if (cutoff_hz < 0.5 * latched_hz) return {};
    return Complaint{{"reader.fir_cutoff_hz", "reader.latch_hz"},
                     fmt::format("a cut-off of {:g} Hz is not below half of the latching rate, {:g} Hz", cutoff_hz,
                                 0.5 * latched_hz)};
}

Finding filter_sees_the_dither(const Scenario& s) {
    if (!takes_samples(s) || s.reader.stripping != reader::Stripping::fir) return {};
    const double latched_hz = latch_hz(s);
    if (s.dither.frequency_hz < 0.5 * latched_hz) return {};
    return Complaint{{"reader.latch_hz", "dither.frequency_hz"},
                     fmt::format("a low-pass filter takes out a dither of {:g} Hz where more than {:g} ticks a second "
                                 "are latched, and there are {:g}; set a higher reader.latch_hz",
                                 s.dither.frequency_hz, 2.0 * s.dither.frequency_hz, latched_hz)};
}

Finding notch_fits(const Scenario& s) {
    if (!takes_samples(s) || s.reader.stripping != reader::Stripping::notch) return {};
    const double latched_hz = latch_hz(s);
    const double alias_hz = std::abs(std::remainder(s.dither.frequency_hz, latched_hz));
    const double room_hz = std::min(alias_hz, 0.5 * latched_hz - alias_hz);
    if (room_hz >= 2.0 * s.reader.notch_bandwidth_hz) return {};
    return Complaint{{"reader.notch_bandwidth_hz", "reader.latch_hz", "dither.frequency_hz"},
                     fmt::format("ticks at {:g} Hz see the dither at {:g} Hz, within two bandwidths of zero or of half "
                                 "the latching rate, where a canceller cannot tell it from a rotation",
                                 latched_hz, alias_hz)};
}

Finding reference_is_in_time(const Scenario& s) {
    if (!takes_samples(s) || s.reader.reference_delay_s < 0.25 / s.dither.frequency_hz) return {};
    return Complaint{{"reader.reference_delay_s", "dither.frequency_hz"},
                     fmt::format("a delay of {:g} s is not below a quarter of a dither cycle, {:.4g} s",
                                 s.reader.reference_delay_s, 0.25 / s.dither.frequency_hz)};
}

constexpr std::array all_record_rules = {
    Rule{"A record of turns is one of an arm without compensator.", turns_are_not_compensated},
    Rule{"The rate of the reader's ticks is a whole multiple of that of the samples.", ticks_make_samples},
    Rule{"The reader's low-pass filter has an even order and a cut-off below half of the latching rate.", filter_fits},
    Rule{"A reader that has only a low-pass filter against the dither latches more than twice a dither cycle.",
         filter_sees_the_dither},
    Rule{"The reader's adaptive canceller sees the dither at a frequency apart from zero and from half of the "
         "latching rate.",
         notch_fits},
    Rule{"The reference of the dither is late by less than a quarter of a cycle.", reference_is_in_time},
};

}  // namespace

std::span<const Rule> record_rules() { return all_record_rules; }

}  // namespace ringlock::scenario
