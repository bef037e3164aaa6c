#include "analysis/closure/report/closed_scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/text/render.hpp"

namespace ringlock::closure {

namespace {

using scenario::Scenario;

constexpr std::string_view placeholder_mark = "Placeholder: ";

const Estimate* find(const std::vector<Estimate>& estimates, std::string_view name) {
    for (const Estimate& estimate : estimates) {
        if (estimate.name == name && std::isfinite(estimate.value)) return &estimate;
    }
    return nullptr;
}

double estimated(const std::vector<Estimate>& estimates, std::string_view name, double otherwise) {
    const Estimate* estimate = find(estimates, name);
    return estimate != nullptr ? estimate->value : otherwise;
}

std::string fitted(const Estimate& estimate) {
    return std::isfinite(estimate.sd) ? fmt::format("Fitted, standard error {:.2g}.", estimate.sd)
                                      : "Fitted; the fit gives no standard error.";
}

/// Fills the scenario of a closed model, and records the origin of each value.
class Filler {
   public:
    Filler(const record::Record& record, const Closure& closure) : record_(record), closure_(closure) {
        for (auto& [effect, values] : scenario().effects) {
            const effects::Effect* known = effects::find(effect);
            for (const effects::Parameter& parameter : known->parameters()) {
                // The standard device has quantum noise; this device has the noise that was found.
                if (parameter.role == effects::Role::deviation) values.at(std::string(parameter.name)) = 0.0;
            }
        }
        scenario().ensemble.dither_asymmetry_sd_ratio = 0.0;
        scenario().ensemble.dither_amplitude_sd_relative = 0.0;
        scenario().ensemble.gyros = 8;
    }

    ClosedScenario fill() {
        if (record_.turns) {
            take_device_of_turns();
        } else {
            take_device_of_samples();
        }
        Scenario& s = scenario();
        s.input.sweep_stop_deg_h = s.input.rate_deg_h;
        s.output.sample_interval_s =
            std::max(1.5 / s.dither.frequency_hz, std::min(1.0, s.ensemble.duration_s / 300.0));
        remark("ensemble.duration_s", "Length of the record.");
        take_exposure();
        for (const Step& step : closure_.steps) take(step);
        if (!record_.turns) {
            drop_reader_that_does_not_fit();
            drop_rate_that_no_gyro_follows();
        }
        if (closure_.unexplained) {
            cannot_hold(fmt::format("structure that no effect of the library explains, in {}: {}",
                                    name_of(closure_.unexplained->where), closure_.unexplained->description()));
        }
        if (closure_.disturbed_share > 0.0) {
            cannot_hold(fmt::format("the disturbed stretches, {:.2g} % of the record, which the fit leaves out",
                                    100.0 * closure_.disturbed_share));
        }
        return std::move(closed_);
    }

   private:
    Scenario& scenario() { return closed_.scenario; }
    void remark(const std::string& key, std::string text) { closed_.remarks[key] = std::move(text); }
    void cannot_hold(std::string finding) { closed_.not_held.push_back(std::move(finding)); }

    /// The declared value, or the present one as a placeholder.
    void take_declared(const std::string& key, const std::optional<double>& declared, double& to) {
        if (declared) {
            to = *declared;
            remark(key, "Declared by the record.");
        } else {
            remark(key, fmt::format("{}the record neither declares nor determines it; "
                                    "the value is that of the standard gyro.",
                                    placeholder_mark));
        }
    }
    /// The estimate of the base model, or the present value as a placeholder.
    bool take_estimate(const std::string& key, std::string_view name, double& to) {
        const Estimate* estimate = find(closure_.base, name);
        if (estimate != nullptr) {
            to = estimate->value;
            remark(key, fitted(*estimate));
        } else {
            take_declared(key, std::nullopt, to);
        }
        return estimate != nullptr;
    }
    void take_mean_rate(std::string_view name) {
        const Estimate* estimate = find(closure_.base, name);
        if (estimate == nullptr) return;
        std::string text = fitted(*estimate);
        if (closure_.mean_input_rate_deg_h != 0.0) {
            text += fmt::format(" The mean of the known input, {:.6g} deg/h, is part of it.",
                                closure_.mean_input_rate_deg_h);
        }
        remark("input.rate_deg_h", std::move(text));
    }

    void take_device_of_turns() {
        Scenario& s = scenario();
        take_declared("gyro.scale_factor_arcsec", record_.declared.scale_factor_arcsec, s.gyro.scale_factor_arcsec);
        take_estimate("gyro.lockin_threshold_deg_h", "lockin_threshold_deg_h", s.gyro.lockin_threshold_deg_h);
        take_estimate("dither.frequency_hz", "dither_frequency_hz", s.dither.frequency_hz);
        take_estimate("dither.peak_rate_deg_s", "dither_peak_rate_deg_s", s.dither.peak_rate_deg_s);
        s.input.rate_deg_h = estimated(closure_.base, "bias_deg_h", 0.0) + closure_.mean_input_rate_deg_h;
        take_mean_rate("bias_deg_h");
        const double most_noise = options.report.most_detector_noise;
        double& noise = s.readout.detector_noise_relative;
        const double standard = noise;
        if (take_estimate("readout.detector_noise_relative", "readout_noise_rad", noise) && noise > most_noise) {
            cannot_hold(fmt::format("detector noise of {:.3g}, which is more than a scenario allows", noise));
        }
        noise = std::clamp(noise, 0.0, most_noise);
        const double injected = estimated(closure_.base, "injected_noise_rad", 0.0);
        const bool noisy = injected > options.report.least_injected_rad;
        if (noisy) {
            take_estimate("noise_injection.turn_phase_rms_rad", "injected_noise_rad",
                          s.noise_injection.turn_phase_rms_rad);
        }
        const Estimate* wander = find(closure_.base, "amplitude_wander_rad");
        const double readout = estimated(closure_.base, "readout_noise_rad", standard);
        if (wander != nullptr && wander->value > options.report.least_wander * readout) {
            const double w = units::two_pi * s.dither.frequency_hz;
            const double amplitude_rad =
                units::two_pi * s.dither.peak_rate_deg_s * units::deg_h_per_deg_s / (s.gyro.scale_factor_arcsec * w);
            s.dither.amplitude_wander_relative_rt_s =
                wander->value / amplitude_rad * std::sqrt(2.0 * s.dither.frequency_hz);
            remark("dither.amplitude_wander_relative_rt_s",
                   fmt::format("Fitted as {:.4g} rad from turn to turn.", wander->value));
        }
        const auto& time_s = record_.turns->time_s;
        s.ensemble.duration_s = std::max(10.0, time_s.back() - time_s.front());
        s.record.kind = scenario::RecordKind::turns;
        s.record.trajectory = noisy ? scenario::parse_arm("noise_injected") : scenario::parse_arm("uncompensated");
        s.arms = noisy ? scenario::parse_arms({"ideal", "noise_injected", "noise_injected+compensated",
                                               "noise_injected+compensated_exact"})
                       : scenario::parse_arms({"ideal", "uncompensated", "compensated", "compensated_exact"});
    }

    /// The parameter of the effect that acts on samples in this way: its key, and its value in the scenario.
    struct Place {
        std::string key;
        double* value;
    };
    Place place_of(OnSamples as, effects::Role role) {
        const effects::Effect* effect = first_that_shows(as);
        if (effect == nullptr) throw RunError("the library has no effect of the kind that the closed model needs");
        const std::string parameter(parameter_of(*effect, role).name);
        return {fmt::format("effects.{}.{}", effect->name(), parameter),
                &scenario().effects.at(std::string(effect->name())).at(parameter)};
    }

    void take_device_of_samples() {
        Scenario& s = scenario();
        const record::Samples& samples = *record_.samples;
        const record::Declared& declared = record_.declared;
        s.gyro.lockin_threshold_deg_h = 0.0;
        std::string threshold = "Zero, because the fitted white noises contain the effect of the lock-in on samples.";
        if (declared.lockin_threshold_deg_h) {
            threshold += fmt::format(" The record declares {:.6g} deg/h.", *declared.lockin_threshold_deg_h);
        }
        remark("gyro.lockin_threshold_deg_h", std::move(threshold));
        s.input.rate_deg_h = estimated(closure_.base, "mean_rate_deg_h", 0.0);
        take_mean_rate("mean_rate_deg_h");
        const Place white_rate = place_of(OnSamples::white, effects::Role::deviation);
        *white_rate.value = std::max(0.0, estimated(closure_.base, "white_rate_deg_rt_h", 0.0));
        if (const Estimate* estimate = find(closure_.base, "white_rate_deg_rt_h")) {
            remark(white_rate.key, fitted(*estimate));
        }
        const double scale_factor_arcsec = declared.scale_factor_arcsec.value_or(s.gyro.scale_factor_arcsec);
        const Place resolution = place_of(OnSamples::resolution, effects::Role::sampled);
        if (samples.kind == record::SampleKind::quarter_count) {
            *resolution.value = 0.25 * scale_factor_arcsec;
            remark(resolution.key, "The record holds counts of quarter fringes.");
        }
        double step_arcsec = *resolution.value;
        for (const Step& step : closure_.steps) {
            if (on_samples(*step.effect) != OnSamples::resolution) continue;
            step_arcsec =
                estimated(step.parameters, parameter_of(*step.effect, effects::Role::sampled).name, step_arcsec);
        }
        take_white_angle(step_arcsec);
        take_declared("gyro.scale_factor_arcsec", declared.scale_factor_arcsec, s.gyro.scale_factor_arcsec);
        take_declared("dither.frequency_hz", declared.dither_frequency_hz, s.dither.frequency_hz);
        take_declared("dither.peak_rate_deg_s", declared.dither_peak_rate_deg_s, s.dither.peak_rate_deg_s);
        const std::size_t increments =
            samples.size() - (samples.kind == record::SampleKind::angle_increment_arcsec ? 0 : 1);
        s.ensemble.duration_s = static_cast<double>(increments) / samples.rate_hz;
        s.record.kind = scenario::RecordKind::samples;
        s.record.rate_hz = samples.rate_hz;
        s.record.trajectory = scenario::parse_arm("uncompensated");
        s.arms = scenario::parse_arms({"ideal", "uncompensated"});
    }

    /// The fitted white noise of the angle includes the rounding noise of the steps. The remainder becomes the noise of
    /// the reader's reference, which is white as well.
    void take_white_angle(double step_arcsec) {
        const Estimate* estimate = find(closure_.base, "white_angle_arcsec");
        const double white = estimate != nullptr ? estimate->value : 0.0;
        const double rounding = closure_.rounding_in_noise ? step_arcsec * step_arcsec / 12.0 : 0.0;
        reader::Settings& reader = scenario().reader;
        reader.reference_noise_arcsec =
            std::min(options.report.most_reference_noise_arcsec, std::sqrt(std::max(0.0, white * white - rounding)));
        const std::string key = "reader.reference_noise_arcsec";
        if (estimate != nullptr) remark(key, fitted(*estimate) + " It stands for the white noise of the angle.");
        plain_reader_ = reader;
        plain_remark_ = closed_.remarks[key];
        if (!record_.reader) return;
        reader = record_.reader->settings;
        if (reader.fraction == reader::Fraction::ideal) {
            reader.reference_noise_arcsec = plain_reader_.reference_noise_arcsec;
        } else {
            remark(key, "Declared by the record, as are all keys of its reader.");
        }
        remark("reader.stripping", "Declared by the record.");
        remark("reader.latch_hz", "Declared by the record.");
    }

    /// The declared reader is dropped where it breaks a rule of scenarios, for example because its latching rate is no
    /// multiple of the rate that the samples were found to be resampled from.
    void drop_reader_that_does_not_fit() {
        for (const scenario::Complaint& complaint : scenario::check(scenario())) {
            const bool of_reader = std::any_of(complaint.keys.begin(), complaint.keys.end(),
                                               [](const std::string& key) { return key.starts_with("reader."); });
            if (!of_reader) continue;
            static_cast<reader::Settings&>(scenario().reader) = plain_reader_;
            remark("reader.reference_noise_arcsec", plain_remark_);
            closed_.remarks.erase("reader.stripping");
            closed_.remarks.erase("reader.latch_hz");
            cannot_hold(
                fmt::format("the declared reader together with the effects that were found: {}", complaint.problem));
            return;
        }
    }

    /// In a short record with a varying rate the mean rate is hardly determined. The fitted one may be larger than any
    /// with which the dither passes through the lock-in zone.
    void drop_rate_that_no_gyro_follows() {
        const std::string key = "input.rate_deg_h";
        const std::vector<scenario::Complaint> complaints = scenario::check(scenario());
        const auto about_rate = [&](const scenario::Complaint& complaint) {
            return std::find(complaint.keys.begin(), complaint.keys.end(), key) != complaint.keys.end();
        };
        const auto found = std::find_if(complaints.begin(), complaints.end(), about_rate);
        if (found == complaints.end()) return;
        const double rate_deg_h = record_.declared.input_rate_deg_h.value_or(0.0);
        cannot_hold(fmt::format("the mean rate: {}", found->problem));
        scenario().input.rate_deg_h = scenario().input.sweep_stop_deg_h = rate_deg_h;
        remark(key, fmt::format("{}a dithered gyro cannot follow the fitted mean rate; "
                                "the value is the declared input rate, or zero.",
                                placeholder_mark));
    }

    /// Temperature and input, which a scenario describes by a ramp and a mean.
    void take_exposure() {
        const record::Track& input = record_.input_rate_deg_h;
        if (!input.empty() && std::any_of(input.value.begin(), input.value.end(),
                                          [&](double value) { return value != input.value.front(); })) {
            remark("input.rate_deg_h",
                   closed_.remarks["input.rate_deg_h"] + " The changes of the known input are left out.");
        }
        const record::Track& track = record_.temperature_c;
        if (track.empty() || track.time_s.size() < 2) return;
        const double span_h = (track.time_s.back() - track.time_s.front()) / 3600.0;
        scenario().environment.temperature_ramp_k_per_h = (track.value.back() - track.value.front()) / span_h;
        remark("environment.temperature_ramp_k_per_h", "From the first and the last temperature of the record.");
    }

    void take(const Step& step) {
        const std::string name = step.name();
        std::string sentence = name;
        for (const Estimate& estimate : step.parameters) {
            sentence += fmt::format(", {} = {}", estimate.name,
                                    estimate.text.empty() ? fmt::format("{:.6g}", estimate.value) : estimate.text);
        }
        const auto found = scenario().effects.find(name);
        if (found == scenario().effects.end()) return cannot_hold(sentence);
        if (!taken_.insert(name).second) {
            return cannot_hold(fmt::format("{} (a scenario holds each effect only once)", sentence));
        }
        effects::Values values = found->second;
        for (const Estimate& estimate : step.parameters) {
            const auto value = values.find(estimate.name);
            if (value != values.end() && std::isfinite(estimate.value)) value->second = estimate.value;
        }
        // Convert times and phases from the record's own clock to the time since its start.
        set_back_clock(*step.effect, values, start_of(record_));
        for (const effects::Parameter& parameter : step.effect->parameters()) {
            double& value = values.at(std::string(parameter.name));
            if (value >= parameter.min && value <= parameter.max) continue;
            cannot_hold(fmt::format("{}: {} = {:.6g} is beyond the range of scenarios, {:g} to {:g}", name,
                                    parameter.name, value, parameter.min, parameter.max));
            value = std::clamp(value, parameter.min, parameter.max);
        }
        found->second = values;
        for (const Estimate& estimate : step.parameters) {
            if (values.contains(estimate.name)) {
                remark(fmt::format("effects.{}.{}", name, estimate.name), fitted(estimate));
            }
        }
        for (const effects::Effect* other : step.confounded_with) {
            tie(name, *other);
        }
    }

    /// A tie is a finding that no scenario can contain: the scenario has one of the effects.
    void tie(const std::string& name, const effects::Effect& other) {
        cannot_hold(fmt::format("{} explains the record as well as {}, which this scenario has", other.name(), name));
    }

    const record::Record& record_;
    const Closure& closure_;
    ClosedScenario closed_;
    std::set<std::string> taken_;
    reader::Settings plain_reader_;
    std::string plain_remark_;
};

}  // namespace

std::vector<std::string> ClosedScenario::placeholders() const {
    std::vector<std::string> keys;
    for (const auto& [key, text] : remarks) {
        if (text.starts_with(placeholder_mark)) keys.push_back(key);
    }
    return keys;
}

double start_of(const record::Record& record) {
    if (record.turns) return record.turns->time_s.front();
    const record::Samples& samples = *record.samples;
    // Increments end at their times; the first angle is the start of the first increment.
    return samples.kind == record::SampleKind::angle_increment_arcsec ? samples.t0_s - 1.0 / samples.rate_hz
                                                                      : samples.t0_s;
}

ClosedScenario closed_scenario(const record::Record& record, const Closure& closure) {
    return Filler(record, closure).fill();
}

std::string to_toml(const ClosedScenario& closed, const std::string& source, Verdict verdict) {
    using scenario::toml_comment;
    std::string text = toml_comment(fmt::format("Result of ringlock closure for {}: {}.", source, name_of(verdict)));
    text += toml_comment(
        "The device as fitted, with the effects that were added. A comment gives the origin of a value; "
        "values without a comment are defaults.");
    for (const std::string& key : closed.placeholders()) text += toml_comment("Placeholder: " + key);
    for (const std::string& finding : closed.not_held) text += toml_comment("Not in this scenario: " + finding);
    return text + "\n" + scenario::to_toml(closed.scenario, closed.remarks);
}

}  // namespace ringlock::closure
