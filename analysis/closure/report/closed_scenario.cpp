#include "analysis/closure/report/closed_scenario.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

namespace {

using scenario::Scenario;

double value_of(const std::vector<Estimate>& estimates, std::string_view name, double otherwise) {
    for (const Estimate& estimate : estimates) {
        if (estimate.name == name && std::isfinite(estimate.value)) return estimate.value;
    }
    return otherwise;
}

void take_device_of_turns(const record::Record& record, const Closure& closure, Scenario& scenario) {
    const Scenario standard;
    scenario.gyro.scale_factor_arcsec = record.declared.scale_factor_arcsec.value_or(standard.gyro.scale_factor_arcsec);
    scenario.gyro.lockin_threshold_deg_h =
        value_of(closure.base, "lockin_threshold_deg_h", standard.gyro.lockin_threshold_deg_h);
    scenario.dither.frequency_hz = value_of(closure.base, "dither_frequency_hz", standard.dither.frequency_hz);
    scenario.dither.peak_rate_deg_s = value_of(closure.base, "dither_peak_rate_deg_s", standard.dither.peak_rate_deg_s);
    scenario.input.rate_deg_h = value_of(closure.base, "bias_deg_h", 0.0) + closure.mean_input_rate_deg_h;
    const double readout = value_of(closure.base, "readout_noise_rad", standard.readout.detector_noise_relative);
    scenario.readout.detector_noise_relative = std::clamp(readout, 0.0, 0.1);
    const double injected = value_of(closure.base, "injected_noise_rad", 0.0);
    // Below a hundredth of a radian nothing is randomised: a dither without noise.
    const bool noisy = injected > 0.01;
    if (noisy) scenario.noise_injection.turn_phase_rms_rad = injected;
    const double wander = value_of(closure.base, "amplitude_wander_rad", 0.0);
    // Below a twentieth of the readout's noise it is not seen from one turn to the next.
    if (wander > 0.05 * readout) {
        const double w = units::two_pi * scenario.dither.frequency_hz;
        const double amplitude_rad = units::two_pi * scenario.dither.peak_rate_deg_s * units::deg_h_per_deg_s /
                                     (scenario.gyro.scale_factor_arcsec * w);
        scenario.dither.amplitude_wander_relative_rt_s =
            wander / amplitude_rad * std::sqrt(2.0 * scenario.dither.frequency_hz);
    }
    const auto& time_s = record.turns->time_s;
    scenario.ensemble.duration_s = std::max(10.0, time_s.back() - time_s.front());
    scenario.record.kind = scenario::RecordKind::turns;
    scenario.record.trajectory =
        noisy ? scenario::RecordTrajectory::noise_injected : scenario::RecordTrajectory::uncompensated;
    scenario.arms = noisy ? scenario::parse_arms({"ideal", "noise_injected", "noise_injected+compensated",
                                                  "noise_injected+compensated_exact"})
                          : scenario::parse_arms({"ideal", "uncompensated", "compensated", "compensated_exact"});
}

void take_device_of_samples(const record::Record& record, const Closure& closure, Scenario& scenario) {
    const record::Samples& samples = *record.samples;
    scenario.gyro.lockin_threshold_deg_h = 0.0;
    scenario.input.rate_deg_h = value_of(closure.base, "mean_rate_deg_h", 0.0);
    scenario.effects.at("quantum_noise").at("deg_rt_h") =
        std::max(0.0, value_of(closure.base, "white_rate_deg_rt_h", 0.0));
    const double scale_factor_arcsec = record.declared.scale_factor_arcsec.value_or(scenario.gyro.scale_factor_arcsec);
    if (samples.kind == record::SampleKind::quarter_count) {
        scenario.effects.at("count_quantization").at("step_arcsec") = 0.25 * scale_factor_arcsec;
    }
    double step_arcsec = scenario.effects.at("count_quantization").at("step_arcsec");
    double readings_hz = samples.rate_hz;
    for (const Step& step : closure.steps) {
        if (step.effect->name() == "count_quantization") step_arcsec = value_of(step.parameters, "step_arcsec", 0.0);
        if (step.effect->name() == "resampling") readings_hz = value_of(step.parameters, "from_hz", readings_hz);
    }
    // What is fitted as white noise of the angle has that of the steps in it.
    const double white = value_of(closure.base, "white_angle_arcsec", 0.0);
    const double rounding = closure.rounding_in_noise ? step_arcsec * step_arcsec / 12.0 : 0.0;
    const double angle_arcsec = std::sqrt(std::max(0.0, white * white - rounding));
    // A phase whose noise is a twentieth of a radian is normal to a thousandth.
    constexpr double noise_rad = 0.05;
    if (angle_arcsec > 1e-6) {
        scenario.gyro.scale_factor_arcsec = std::clamp(units::two_pi * angle_arcsec / noise_rad, 1e-3, 1e3);
        scenario.readout.detector_noise_relative = units::two_pi * angle_arcsec / scenario.gyro.scale_factor_arcsec;
    } else {
        scenario.readout.model = scenario::ReadoutModel::ideal;
        scenario.gyro.scale_factor_arcsec = scale_factor_arcsec;
    }
    // A turn at every reading, so that none is interpolated and each has an error of its own, and fringes enough
    // between turns.
    const double halves = std::max(1.0, std::ceil(2.0 / readings_hz));
    scenario.dither.frequency_hz = 0.5 * halves * readings_hz;
    constexpr double fringes = 200.0;
    scenario.dither.peak_rate_deg_s = 0.5 * fringes * scenario.gyro.scale_factor_arcsec * units::two_pi *
                                      scenario.dither.frequency_hz / units::deg_h_per_deg_s;
    const std::size_t increments =
        samples.size() - (samples.kind == record::SampleKind::angle_increment_arcsec ? 0 : 1);
    scenario.ensemble.duration_s = static_cast<double>(increments) / samples.rate_hz;
    scenario.record.kind = scenario::RecordKind::samples;
    scenario.record.rate_hz = samples.rate_hz;
    scenario.record.trajectory = scenario::RecordTrajectory::uncompensated;
    scenario.arms = scenario::parse_arms({"ideal", "uncompensated"});
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
        const auto found = scenario.effects.find(std::string(step.effect->name()));
        if (found == scenario.effects.end()) continue;
        for (const Estimate& estimate : step.parameters) {
            const auto value = found->second.find(estimate.name);
            if (value != found->second.end()) value->second = estimate.value;
        }
    }
    // The step's time and the line's phase are those of the record's own clock.
    const double start_s = start_of(record);
    auto& when_s = scenario.effects.at("bias_step").at("time_s");
    when_s = std::max(0.0, when_s - start_s);
    auto& line = scenario.effects.at("base_vibration");
    if (line.at("rate_deg_h") != 0.0) {
        line.at("phase_rad") =
            std::remainder(line.at("phase_rad") + units::two_pi * line.at("frequency_hz") * start_s, units::two_pi);
    }
    return scenario;
}

}  // namespace ringlock::closure
