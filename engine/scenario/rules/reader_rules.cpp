#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/units.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/read_arms.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

using reader::Stripping;

/// A rate at which a reader puts out angles, the key that sets it, and a phrase for messages that describes it.
struct Outputs {
    double hz;
    std::string key;
    const char* what;

    double latch_hz(const Scenario& s) const { return reader::latch_hz(s.reader, hz); }
};

/// Outputs for a record of samples; effects on the samples may change their rate.
Outputs outputs_of_record(const Scenario& s) {
    Outputs outputs{s.record.rate_hz, "record.rate_hz", "samples are taken"};
    for (const auto& [effect, values] : active_effects(s)) {
        const auto stage = effect->sample_stage(*values, {});
        if (!stage) continue;
        const double needed_hz = stage->source_hz(outputs.hz);
        if (needed_hz == outputs.hz) continue;
        const effects::Parameter* rate = effects::first_of(*effect, effects::Role::sampled);
        outputs.hz = needed_hz;
        outputs.key = fmt::format("effects.{}.{}", effect->name(), rate->name);
    }
    return outputs;
}

/// All outputs that the scenario's reader makes: for a record of samples, for the arms of a study, or for both.
std::vector<Outputs> all_outputs(const Scenario& s) {
    std::vector<Outputs> all;
    if (s.record.kind == RecordKind::samples) all.push_back(outputs_of_record(s));
    if (reads_arms(s)) all.push_back({s.reader.output_hz, "reader.output_hz", "the arms of a study are read"});
    return all;
}

/// The complaint about the first of these outputs that breaks a rule.
template <class Wrong>
Finding first_of(const Scenario& s, Wrong&& wrong) {
    for (const Outputs& outputs : all_outputs(s)) {
        if (Finding finding = wrong(outputs)) return finding;
    }
    return {};
}

Finding ticks_make_outputs(const Scenario& s) {
    if (s.reader.latch_hz == 0.0) return {};
    return first_of(s, [&](const Outputs& outputs) -> Finding {
        const double ratio = s.reader.latch_hz / outputs.hz;
        if (ratio > 0.5 && std::abs(ratio - std::round(ratio)) < 1e-9 * ratio) return {};
        return Complaint{
            {"reader.latch_hz", outputs.key},
            fmt::format("{:g} Hz are not a whole multiple of the {:g} Hz at which {}; set {:g}, or 0 for the same rate",
                        s.reader.latch_hz, outputs.hz, outputs.what, outputs.hz * std::max(1.0, std::round(ratio)))};
    });
}

Finding filter_fits(const Scenario& s) {
    if (s.reader.stripping != Stripping::fir && s.reader.stripping != Stripping::reference_fir) return {};
    const double cutoff_hz = s.reader.fir_cutoff_hz > 0.0 ? s.reader.fir_cutoff_hz : 0.25 * s.dither.frequency_hz;
    return first_of(s, [&](const Outputs& outputs) -> Finding {
        if (s.reader.fir_order % 2 != 0) {
            return Complaint{{"reader.fir_order"}, "an odd order would delay by half a tick; use an even one"};
        }
        const double latched_hz = outputs.latch_hz(s);
        if (cutoff_hz < 0.5 * latched_hz) return {};
        return Complaint{{"reader.fir_cutoff_hz", "reader.latch_hz", outputs.key},
                         fmt::format("a cut-off of {:g} Hz is not below half of the latching rate, {:g} Hz; "
                                     "set a higher reader.latch_hz",
                                     cutoff_hz, 0.5 * latched_hz)};
    });
}

Finding filter_sees_the_dither(const Scenario& s) {
    if (s.reader.stripping != Stripping::fir) return {};
    return first_of(s, [&](const Outputs& outputs) -> Finding {
        const double latched_hz = outputs.latch_hz(s);
        if (s.dither.frequency_hz < 0.5 * latched_hz) return {};
        return Complaint{{"reader.latch_hz", outputs.key, "dither.frequency_hz"},
                         fmt::format("a low-pass filter takes out a dither of {:g} Hz where more than {:g} ticks "
                                     "a second are latched, and there are {:g}; set a higher reader.latch_hz",
                                     s.dither.frequency_hz, 2.0 * s.dither.frequency_hz, latched_hz)};
    });
}

Finding notch_fits(const Scenario& s) {
    if (s.reader.stripping != Stripping::notch) return {};
    return first_of(s, [&](const Outputs& outputs) -> Finding {
        const double latched_hz = outputs.latch_hz(s);
        const double alias_hz = std::abs(std::remainder(s.dither.frequency_hz, latched_hz));
        const double room_hz = std::min(alias_hz, 0.5 * latched_hz - alias_hz);
        if (room_hz >= 2.0 * s.reader.notch_bandwidth_hz) return {};
        return Complaint{{"reader.notch_bandwidth_hz", "reader.latch_hz", outputs.key, "dither.frequency_hz"},
                         fmt::format("ticks at {:g} Hz see the dither at {:g} Hz, "
                                     "within two bandwidths of zero or of half the latching rate, "
                                     "where a canceller cannot distinguish it from a rotation",
                                     latched_hz, alias_hz)};
    });
}

Finding reference_is_in_time(const Scenario& s) {
    return first_of(s, [&](const Outputs&) -> Finding {
        if (s.reader.reference_delay_s < 0.25 / s.dither.frequency_hz) return {};
        return Complaint{{"reader.reference_delay_s", "dither.frequency_hz"},
                         fmt::format("a delay of {:g} s is not below a quarter of a dither cycle, {:.4g} s",
                                     s.reader.reference_delay_s, 0.25 / s.dither.frequency_hz)};
    });
}

Finding studies_are_stripped(const Scenario& s) {
    if (!reads_arms(s) || s.reader.stripping != Stripping::none) return {};
    return Complaint{{"reader.stripping", "reader.output_hz"},
                     fmt::format("every output of a study's arms would contain the dither, {:.4g} arcsec of it, "
                                 "and random walk, mean rate and yield would be those of the dither; "
                                 "set another stripping, or take reader.output_hz out and record single gyros "
                                 "with `ringlock record`",
                                 phase_amplitude_rad(s) / units::two_pi * s.gyro.scale_factor_arcsec)};
}

Finding outputs_can_be_counted(const Scenario& s) {
    if (!reads_arms(s)) return {};
    constexpr double most_fringes = 1e9;  // differences of counts hold twice as many
    double rate_deg_h = exposure(s).input_rate_deg_h;
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        rate_deg_h += bounds.certain.rate_deg_h + sigmas * bounds.rate_sd_deg_h;
    }
    const double fringes = rate_deg_h / s.gyro.scale_factor_arcsec / s.reader.output_hz;
    if (fringes <= most_fringes) return {};
    return Complaint{
        {"reader.output_hz", "input.rate_deg_h", "input.sweep_stop_deg_h", "input.profile_rate_deg_h"},
        fmt::format("the gyro turns by {:.3g} fringes from an output to the next, and {:g} can be counted; "
                    "set a higher reader.output_hz",
                    fringes, most_fringes)};
}

Finding warm_up_ends(const Scenario& s) {
    if (!reads_arms(s)) return {};
    constexpr double most_records = 10.0;
    const double warm_up_s = static_cast<double>(study_reader(s).warm_up_outputs) / s.reader.output_hz;
    if (warm_up_s <= most_records * s.ensemble.duration_s) return {};
    return Complaint{{"reader.reference_learning_s", "reader.notch_bandwidth_hz", "reader.fir_order",
                      "ensemble.duration_s", "reader.output_hz"},
                     fmt::format("the readers of a study are simulated for {:.3g} s before they are fit for use, "
                                 "more than {:g} times the record of {:g} s; let the reference be learnt faster, "
                                 "the notch be wider or the filter shorter, or set a longer ensemble.duration_s",
                                 warm_up_s, most_records, s.ensemble.duration_s)};
}

constexpr std::array all_reader_rules = {
    Rule{"The rate of the reader's ticks is a whole multiple of that of the samples, "
         "and of that at which the arms of a study are read.",
         ticks_make_outputs},
    Rule{"The reader's low-pass filter has an even order and a cut-off below half of the latching rate.", filter_fits},
    Rule{"A reader that has only a low-pass filter against the dither latches more than twice a dither cycle.",
         filter_sees_the_dither},
    Rule{"The reader's adaptive canceller sees the dither at a frequency apart from zero and from half "
         "of the latching rate.",
         notch_fits},
    Rule{"The reference of the dither is late by less than a quarter of a cycle.", reference_is_in_time},
    Rule{"The dither is taken out of the arms of a study that are read (reader.output_hz).", studies_are_stripped},
    Rule{"A gyro turns by no more than 1e9 fringes from an output of a study's readers to the next.",
         outputs_can_be_counted},
    Rule{"The readers of a study are fit for use within ten times the duration of its record.", warm_up_ends},
};

}  // namespace

std::span<const Rule> reader_rules() { return all_reader_rules; }

}  // namespace ringlock::scenario
