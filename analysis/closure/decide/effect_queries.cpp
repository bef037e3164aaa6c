#include "analysis/closure/decide/effect_queries.hpp"

#include <algorithm>
#include <string>

#include "engine/core/error.hpp"

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

OnSamples of_angle(const effects::Effect& effect) {
    if (has(effect, Role::frequency)) return OnSamples::rate_line;
    if (!has(effect, Role::size)) return OnSamples::other;
    if (has(effect, Role::time)) return OnSamples::step;
    const bool size_alone = effect.parameters().size() == parameters_of(effect, Role::setting).size() + 1;
    return size_alone ? OnSamples::rate : OnSamples::other;
}

}  // namespace

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

Estimate estimate_of(const effects::Effect& effect, std::string_view parameter, double value, double sd) {
    return {std::string(effect.name()), std::string(parameter), value, sd};
}

}  // namespace ringlock::closure
