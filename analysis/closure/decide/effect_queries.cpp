#include "analysis/closure/decide/effect_queries.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

using effects::Role;

namespace {

bool has(const effects::Effect& effect, Role role) { return effects::first_of(effect, role) != nullptr; }

OnSamples of_place(const effects::Effect& effect, effects::SampleStage::Place place) {
    switch (place) {
        case effects::SampleStage::Place::motion:
            return OnSamples::motion;
        case effects::SampleStage::Place::output:
            return has(effect, Role::frequency) ? OnSamples::angle_line : OnSamples::other;
        case effects::SampleStage::Place::resolution:
            return OnSamples::resolution;
        case effects::SampleStage::Place::transport:
            break;
    }
    return OnSamples::transport;
}

/// The values at which this amplitude alone acts; an effect that begins at a time begins within the intervals that are
/// compared.
effects::Values values_of_one(const effects::Effect& effect, const Amplitude& amplitude) {
    effects::Values values = values_at_rest(effect);
    for (const effects::Parameter& parameter : effect.parameters()) {
        if (parameter.role == Role::time) values.at(std::string(parameter.name)) = 1.0;
    }
    values.at(std::string(amplitude.value->name)) = probe;
    return values;
}

/// Whether one amplitude of an effect has the same result as one of another effect, each by itself.
bool act_alike(const effects::Effect& a, const Amplitude& of_a, const effects::Effect& b, const Amplitude& of_b) {
    if ((of_a.turned_by == nullptr) != (of_b.turned_by == nullptr)) return false;
    const auto random = [](const effects::Effect& effect) {
        return has(effect, Role::deviation) || has(effect, Role::probability) || has(effect, Role::sampled);
    };
    if (random(a) || random(b)) return false;
    const effects::Values at_a = values_of_one(a, of_a);
    const effects::Values at_b = values_of_one(b, of_b);
    const gyro::Setup setup = configured(a, at_a);
    if (setup != configured(b, at_b)) return false;
    bool acts = setup != gyro::Setup{};
    const effects::ChangeOver change_a = a.change(at_a);
    const effects::ChangeOver change_b = b.change(at_b);
    for (const double start_s : {0.0, 0.75, 2.0}) {
        for (const double temperature_k : {0.0, 1.0}) {
            const effects::Interval at{start_s, 0.5, {temperature_k, 2.0 * temperature_k}, {temperature_k, 3.0}};
            const effects::Change change = change_a(at);
            if (change != change_b(at)) return false;
            acts = acts || change != effects::Change{};
        }
    }
    return acts;
}

OnSamples of_angle(const effects::Effect& effect) {
    if (has(effect, Role::frequency)) return OnSamples::rate_line;
    if (!has(effect, Role::size)) return OnSamples::other;
    if (has(effect, Role::time)) return OnSamples::step;
    const bool size_alone = effect.parameters().size() == parameters_of(effect, Role::setting).size() + 1;
    return size_alone ? OnSamples::rate : OnSamples::other;
}

}  // namespace

gyro::Setup configured(const effects::Effect& effect, const effects::Values& values) {
    gyro::Setup setup;
    effect.configure(values, setup);
    return setup;
}

OnSamples on_samples(const effects::Effect& effect) {
    if (const auto place = effect.sample_place()) return of_place(effect, *place);
    if (effect.adds_angle()) return of_angle(effect);
    if (!has(effect, Role::deviation)) return OnSamples::nothing;
    const effects::RateNoise noise = effect.rate_noise(unit_values(effect));
    if (noise.walk_deg2_h2_per_s > 0.0) return OnSamples::walk;
    if (!noise.terms.empty()) return OnSamples::flicker;
    return noise.white_deg2_h2_s > 0.0 ? OnSamples::white : OnSamples::nothing;
}

Effects effects_that_show(OnSamples as, std::span<const effects::Effect* const> library) {
    Effects all;
    std::copy_if(library.begin(), library.end(), std::back_inserter(all),
                 [as](const effects::Effect* effect) { return on_samples(*effect) == as; });
    std::stable_sort(all.begin(), all.end(), [](const effects::Effect* a, const effects::Effect* b) {
        return a->parameters().size() < b->parameters().size();
    });
    return all;
}

const effects::Effect* first_that_shows(OnSamples as, std::span<const effects::Effect* const> library) {
    const Effects all = effects_that_show(as, library);
    return all.empty() ? nullptr : all.front();
}

double effects_on_samples() {
    const auto library = effects::registry();
    return static_cast<double>(std::count_if(library.begin(), library.end(), [](const effects::Effect* effect) {
        return on_samples(*effect) != OnSamples::nothing;
    }));
}

bool is_slow_rate(const effects::Effect& effect) {
    const OnSamples as = on_samples(effect);
    return as == OnSamples::rate || as == OnSamples::step || as == OnSamples::walk || as == OnSamples::flicker;
}

bool is_line(const effects::Effect& effect) {
    const OnSamples as = on_samples(effect);
    return as == OnSamples::rate_line || as == OnSamples::angle_line;
}

effects::Values unit_values(const effects::Effect& effect) {
    effects::Values values;
    for (const effects::Parameter& parameter : effect.parameters()) {
        const bool scales = parameter.role == Role::size || parameter.role == Role::deviation;
        values.emplace(parameter.name, scales ? 1.0 : parameter.default_value);
    }
    return values;
}

std::function<double(const effects::Interval&)> unit_angle(const effects::Effect& effect) {
    return
        [change = effect.change(unit_values(effect))](const effects::Interval& at) { return change(at).angle_arcsec; };
}

effects::Values values_at_rest(const effects::Effect& effect) {
    effects::Values values;
    for (const effects::Parameter& parameter : effect.parameters()) {
        const bool active = parameter.role == Role::size || parameter.role == Role::deviation ||
                            parameter.role == Role::probability || parameter.role == Role::phase;
        values[std::string(parameter.name)] = active ? 0.0 : parameter.default_value;
    }
    return values;
}

bool is_own_phase(const effects::Effect& effect, const effects::Parameter& parameter) {
    if (parameter.role != Role::phase) return false;
    effects::Values values = values_at_rest(effect);
    values.at(std::string(parameter.name)) = probe;
    return effect.active(values);
}

std::vector<Amplitude> amplitudes_of(const effects::Effect& effect) {
    std::vector<Amplitude> all;
    for (const effects::Parameter& parameter : effect.parameters()) {
        if (parameter.role == Role::size || is_own_phase(effect, parameter)) {
            all.push_back({&parameter, nullptr});
        } else if (parameter.role == Role::phase && !all.empty()) {
            all.back().turned_by = &parameter;
        }
    }
    return all;
}

bool changes_angle_only(const effects::Effect& effect) {
    const effects::Changes changes = effect.changes();
    if (!changes.angle || changes.threshold || changes.coupling_phase) return false;
    effects::Values values = values_at_rest(effect);
    for (const Amplitude& amplitude : amplitudes_of(effect)) values.at(std::string(amplitude.value->name)) = probe;
    return configured(effect, values) == gyro::Setup{};
}

bool contains(const effects::Effect& larger, const effects::Effect& smaller) {
    const std::vector<Amplitude> of_larger = amplitudes_of(larger);
    const std::vector<Amplitude> of_smaller = amplitudes_of(smaller);
    if (of_smaller.empty() || of_larger.size() <= of_smaller.size()) return false;
    return std::all_of(of_smaller.begin(), of_smaller.end(), [&](const Amplitude& wanted) {
        return std::any_of(of_larger.begin(), of_larger.end(),
                           [&](const Amplitude& amplitude) { return act_alike(larger, amplitude, smaller, wanted); });
    });
}

effects::Values values_as_larger(const effects::Effect& larger, const effects::Effect& smaller,
                                 const effects::Values& values) {
    effects::Values all = values_at_rest(larger);
    const auto set = [&](const effects::Parameter* to, const effects::Parameter* from) {
        if (to != nullptr && from != nullptr) all.at(std::string(to->name)) = value_of(values, *from);
    };
    for (const Role role : {Role::time, Role::frequency}) {
        set(effects::first_of(larger, role), effects::first_of(smaller, role));
    }
    for (const Amplitude& to : amplitudes_of(larger)) {
        for (const Amplitude& from : amplitudes_of(smaller)) {
            if (!act_alike(larger, to, smaller, from)) continue;
            set(to.value, from.value);
            set(to.turned_by, from.turned_by);
        }
    }
    return all;
}

std::vector<Amplitude> in_addition(const effects::Effect& larger, const effects::Effect& smaller) {
    const std::vector<Amplitude> of_smaller = amplitudes_of(smaller);
    std::vector<Amplitude> all = amplitudes_of(larger);
    std::erase_if(all, [&](const Amplitude& amplitude) {
        return std::any_of(of_smaller.begin(), of_smaller.end(),
                           [&](const Amplitude& other) { return act_alike(larger, amplitude, smaller, other); });
    });
    return all;
}

double rate_per_kelvin(const effects::Effect& effect) {
    const auto angle = unit_angle(effect);
    return angle({.duration_s = 1.0, .temperature_change_k = {1.0, 1.0}}) - angle({.duration_s = 1.0});
}

const effects::Parameter& parameter_of(const effects::Effect& effect, Role role) {
    const effects::Parameter* found = effects::first_of(effect, role);
    if (found == nullptr)
        throw RunError("effect " + std::string(effect.name()) + " has no parameter of the role needed");
    return *found;
}

const effects::Parameter& parameter_of(const effects::Effect& effect, std::string_view name) {
    const auto all = effect.parameters();
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const effects::Parameter& p) { return p.name == name; });
    if (found == all.end()) {
        throw RunError("effect " + std::string(effect.name()) + " has no parameter " + std::string(name));
    }
    return *found;
}

std::vector<const effects::Parameter*> parameters_of(const effects::Effect& effect, Role role) {
    std::vector<const effects::Parameter*> all;
    for (const effects::Parameter& parameter : effect.parameters()) {
        if (parameter.role == role) all.push_back(&parameter);
    }
    return all;
}

double value_of(const effects::Values& values, const effects::Parameter& parameter) {
    return values.at(std::string(parameter.name));
}

Configures configured_by(const effects::Effect& effect) {
    const gyro::Setup plain;
    gyro::Setup setup;
    effects::Values values;
    for (const effects::Parameter& parameter : effect.parameters()) {
        const bool acts =
            parameter.role == Role::size || parameter.role == Role::probability || parameter.role == Role::phase;
        values.emplace(parameter.name, acts ? probe : parameter.default_value);
    }
    effect.configure(values, setup);
    return {
        .dither_shape = setup.dither_asymmetry_ratio != plain.dither_asymmetry_ratio ||
                        setup.dither_harmonic_ratio != plain.dither_harmonic_ratio,
        .reading = setup.ellipse != plain.ellipse || setup.missed_count_probability != plain.missed_count_probability,
        .coupling = setup.coupling_phase_rad != plain.coupling_phase_rad ||
                    setup.lockin_second_ratio != plain.lockin_second_ratio ||
                    setup.lockin_turn_asymmetry != plain.lockin_turn_asymmetry};
}

void set_back_clock(const effects::Effect& effect, effects::Values& values, double start_s) {
    if (!effect.adds_angle()) return;
    const auto of = [&](Role role) -> double* {
        const effects::Parameter* found = effects::first_of(effect, role);
        return found == nullptr ? nullptr : &values.at(std::string(found->name));
    };
    if (double* time_s = of(Role::time)) *time_s = std::max(0.0, *time_s - start_s);
    double* phase_rad = of(Role::phase);
    const double* frequency_hz = of(Role::frequency);
    if (phase_rad == nullptr || frequency_hz == nullptr) return;
    *phase_rad = std::remainder(*phase_rad + units::two_pi * *frequency_hz * start_s, units::two_pi);
}

Estimate estimate_of(const effects::Effect& effect, std::string_view parameter, double value, double sd) {
    return {std::string(effect.name()), std::string(parameter), value, sd};
}

}  // namespace ringlock::closure
