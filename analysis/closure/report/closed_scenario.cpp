#include "analysis/closure/report/closed_scenario.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"
#include "engine/scenario/check.hpp"

namespace ringlock::closure {

namespace {

using scenario::Scenario;

double estimated(const std::vector<Estimate>& estimates, std::string_view name, double otherwise) {
    for (const Estimate& estimate : estimates) {
        if (estimate.name == name && std::isfinite(estimate.value)) return estimate.value;
    }
    return otherwise;
}

/// A parameter of the library's effect that shows on samples in this way, in the scenario's table of effects.
double* value_in(Scenario& scenario, OnSamples as, effects::Role role) {
    const effects::Effect* effect = first_that_shows(as);
    if (effect == nullptr) throw RunError("the library has no effect of the kind that the closed model needs");
    return &scenario.effects.at(std::string(effect->name())).at(std::string(parameter_of(*effect, role).name));
}

void take_device_of_turns(const record::Record& record, const Closure& closure, Scenario& scenario) {
    const Scenario standard;
    scenario.gyro.scale_factor_arcsec = record.declared.scale_factor_arcsec.value_or(standard.gyro.scale_factor_arcsec);
    scenario.gyro.lockin_threshold_deg_h =
        estimated(closure.base, "lockin_threshold_deg_h", standard.gyro.lockin_threshold_deg_h);
    scenario.dither.frequency_hz = estimated(closure.base, "dither_frequency_hz", standard.dither.frequency_hz);
    scenario.dither.peak_rate_deg_s =
        estimated(closure.base, "dither_peak_rate_deg_s", standard.dither.peak_rate_deg_s);
    scenario.input.rate_deg_h = estimated(closure.base, "bias_deg_h", 0.0) + closure.mean_input_rate_deg_h;
    const double readout = estimated(closure.base, "readout_noise_rad", standard.readout.detector_noise_relative);
    scenario.readout.detector_noise_relative = std::clamp(readout, 0.0, 0.1);
    const double injected = estimated(closure.base, "injected_noise_rad", 0.0);
    const bool noisy = injected > options.report.least_injected_rad;
    if (noisy) scenario.noise_injection.turn_phase_rms_rad = injected;
    const double wander = estimated(closure.base, "amplitude_wander_rad", 0.0);
    if (wander > options.report.least_wander * readout) {
        const double w = units::two_pi * scenario.dither.frequency_hz;
        const double amplitude_rad = units::two_pi * scenario.dither.peak_rate_deg_s * units::deg_h_per_deg_s /
                                     (scenario.gyro.scale_factor_arcsec * w);
        scenario.dither.amplitude_wander_relative_rt_s =
            wander / amplitude_rad * std::sqrt(2.0 * scenario.dither.frequency_hz);
    }
    const auto& time_s = record.turns->time_s;
    scenario.ensemble.duration_s = std::max(10.0, time_s.back() - time_s.front());
    scenario.record.kind = scenario::RecordKind::turns;
    scenario.record.trajectory = noisy ? scenario::parse_arm("noise_injected") : scenario::parse_arm("uncompensated");
    scenario.arms = noisy ? scenario::parse_arms({"ideal", "noise_injected", "noise_injected+compensated",
                                                  "noise_injected+compensated_exact"})
                          : scenario::parse_arms({"ideal", "uncompensated", "compensated", "compensated_exact"});
}

void take_device_of_samples(const record::Record& record, const Closure& closure, Scenario& scenario) {
    const record::Samples& samples = *record.samples;
    scenario.gyro.lockin_threshold_deg_h = 0.0;
    scenario.input.rate_deg_h = estimated(closure.base, "mean_rate_deg_h", 0.0);
    *value_in(scenario, OnSamples::white, effects::Role::deviation) =
        std::max(0.0, estimated(closure.base, "white_rate_deg_rt_h", 0.0));
    const double scale_factor_arcsec = record.declared.scale_factor_arcsec.value_or(scenario.gyro.scale_factor_arcsec);
    if (samples.kind == record::SampleKind::quarter_count) {
        *value_in(scenario, OnSamples::resolution, effects::Role::sampled) = 0.25 * scale_factor_arcsec;
    }
    double step_arcsec = *value_in(scenario, OnSamples::resolution, effects::Role::sampled);
    for (const Step& step : closure.steps) {
        if (on_samples(*step.effect) != OnSamples::resolution) continue;
        step_arcsec = estimated(step.parameters, parameter_of(*step.effect, effects::Role::sampled).name, 0.0);
    }
    // The fitted white noise of the angle includes the rounding noise of the steps. The remainder becomes the noise of
    // the reader's reference, which is white as well.
    const double white = estimated(closure.base, "white_angle_arcsec", 0.0);
    const double rounding = closure.rounding_in_noise ? step_arcsec * step_arcsec / 12.0 : 0.0;
    scenario.reader.reference_noise_arcsec = std::min(1e6, std::sqrt(std::max(0.0, white * white - rounding)));
    const reader::Settings plain = scenario.reader;
    if (record.reader) {
        scenario.reader = record.reader->settings;
        if (scenario.reader.fraction == reader::Fraction::ideal) {
            scenario.reader.reference_noise_arcsec = plain.reference_noise_arcsec;
        }
    }
    // Samples do not determine these constants. The declared values are kept; where none are declared, those of the
    // standard gyro are placeholders.
    scenario.gyro.scale_factor_arcsec = scale_factor_arcsec;
    scenario.dither.frequency_hz = record.declared.dither_frequency_hz.value_or(scenario.dither.frequency_hz);
    scenario.dither.peak_rate_deg_s = record.declared.dither_peak_rate_deg_s.value_or(scenario.dither.peak_rate_deg_s);
    const std::size_t increments =
        samples.size() - (samples.kind == record::SampleKind::angle_increment_arcsec ? 0 : 1);
    scenario.ensemble.duration_s = static_cast<double>(increments) / samples.rate_hz;
    scenario.record.kind = scenario::RecordKind::samples;
    scenario.record.rate_hz = samples.rate_hz;
    scenario.record.trajectory = scenario::parse_arm("uncompensated");
    scenario.arms = scenario::parse_arms({"ideal", "uncompensated"});
    // The declared reader is dropped where it breaks a rule of scenarios, for example because its latching rate is no
    // multiple of the rate that the samples were found to be resampled from.
    for (const scenario::Complaint& complaint : scenario::check(scenario)) {
        for (const std::string& key : complaint.keys) {
            if (key.starts_with("reader.")) scenario.reader = plain;
        }
    }
}

}  // namespace

double start_of(const record::Record& record) {
    if (record.turns) return record.turns->time_s.front();
    const record::Samples& samples = *record.samples;
    // Increments end at their times; of angles the first is only where the first increment begins.
    return samples.kind == record::SampleKind::angle_increment_arcsec ? samples.t0_s - 1.0 / samples.rate_hz
                                                                      : samples.t0_s;
}

Scenario closed_scenario(const record::Record& record, const Closure& closure) {
    Scenario scenario;
    for (auto& [effect, values] : scenario.effects) {
        const effects::Effect* known = effects::find(effect);
        for (const effects::Parameter& parameter : known->parameters()) {
            // The standard device has quantum noise; this one has what was found.
            if (parameter.role == effects::Role::deviation) values.at(std::string(parameter.name)) = 0.0;
        }
    }
    scenario.ensemble.dither_asymmetry_sd_ratio = 0.0;
    scenario.ensemble.dither_amplitude_sd_relative = 0.0;
    scenario.ensemble.gyros = 8;
    if (record.turns) {
        take_device_of_turns(record, closure, scenario);
    } else {
        take_device_of_samples(record, closure, scenario);
    }
    scenario.input.sweep_stop_deg_h = scenario.input.rate_deg_h;
    scenario.output.sample_interval_s =
        std::max(1.5 / scenario.dither.frequency_hz, std::min(1.0, scenario.ensemble.duration_s / 300.0));
    if (!record.temperature_c.empty() && record.temperature_c.time_s.size() > 1) {
        const auto& t = record.temperature_c;
        const double span_h = (t.time_s.back() - t.time_s.front()) / 3600.0;
        scenario.environment.temperature_ramp_k_per_h = (t.value.back() - t.value.front()) / span_h;
    }
    for (const Step& step : closure.steps) {
        const auto found = scenario.effects.find(step.name());
        if (found == scenario.effects.end()) continue;
        for (const Estimate& estimate : step.parameters) {
            const auto value = found->second.find(estimate.name);
            if (value != found->second.end()) value->second = estimate.value;
        }
    }
    // Times and phases were those of the record's own clock.
    for (const Step& step : closure.steps) {
        const auto found = scenario.effects.find(step.name());
        if (found != scenario.effects.end()) set_back_clock(*step.effect, found->second, start_of(record));
    }
    return scenario;
}

}  // namespace ringlock::closure
