#include "analysis/closure/turns/model/effect_roles.hpp"

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/decide/evidence.hpp"

namespace ringlock::closure {

namespace {

using effects::Effect;
using effects::Role;

/// A value of any parameter that shows in a setup and is allowed.
constexpr double probe = 1e-3;

gyro::Setup configured(const Effect& effect, const effects::Values& values) {
    gyro::Setup setup;
    effect.configure(values, setup);
    return setup;
}

/// The parameter that, by itself, changes this constant; empty where none does.
template <class Constant>
std::string parameter_of(const Effect& effect, Constant&& constant) {
    const effects::Values rest = values_at_rest(effect);
    const double at_rest = constant(configured(effect, rest));
    for (const effects::Parameter& parameter : effect.parameters()) {
        const std::string name(parameter.name);
        effects::Values values = rest;
        values.at(name) = probe;
        if (constant(configured(effect, values)) != at_rest) return name;
    }
    return {};
}

EffectRoles find_roles() {
    EffectRoles roles;
    // Each role goes to the first effect whose parameters change all of its constants.
    for (const Effect* effect : effects::registry()) {
        const auto of = [effect](auto&& constant) { return parameter_of(*effect, constant); };
        if (roles.asymmetry.effect == nullptr) {
            const std::string ratio = of([](const gyro::Setup& s) { return s.dither_asymmetry_ratio; });
            if (!ratio.empty()) roles.asymmetry = {effect, ratio};
        }
        if (roles.harmonic.effect == nullptr) {
            const std::string ratio = of([](const gyro::Setup& s) { return s.dither_harmonic_ratio; });
            const std::string phase_rad = of([](const gyro::Setup& s) { return s.dither_harmonic_phase_rad; });
            if (!ratio.empty() && !phase_rad.empty()) roles.harmonic = {effect, ratio, phase_rad};
        }
        if (roles.ellipse.effect == nullptr) {
            const EffectRoles::Ellipse ellipse = {effect, of([](const gyro::Setup& s) { return s.ellipse.gain; }),
                                                  of([](const gyro::Setup& s) { return s.ellipse.offset_sin; }),
                                                  of([](const gyro::Setup& s) { return s.ellipse.offset_cos; }),
                                                  of([](const gyro::Setup& s) { return s.ellipse.orthogonality_rad; })};
            if (!ellipse.gain.empty() && !ellipse.offset_sin.empty() && !ellipse.offset_cos.empty() &&
                !ellipse.orthogonality_rad.empty()) {
                roles.ellipse = ellipse;
            }
        }
        if (roles.missed_counts.effect == nullptr) {
            const std::string probability = of([](const gyro::Setup& s) { return s.missed_count_probability; });
            if (!probability.empty()) roles.missed_counts = {effect, probability};
        }
    }
    return roles;
}

}  // namespace

effects::Values values_at_rest(const Effect& effect) {
    effects::Values values;
    for (const effects::Parameter& parameter : effect.parameters()) {
        const bool active = parameter.role == Role::size || parameter.role == Role::deviation ||
                            parameter.role == Role::probability || parameter.role == Role::phase;
        values[std::string(parameter.name)] = active ? 0.0 : parameter.default_value;
    }
    return values;
}

bool is_own_phase(const Effect& effect, const effects::Parameter& parameter) {
    if (parameter.role != Role::phase) return false;
    effects::Values values = values_at_rest(effect);
    values.at(std::string(parameter.name)) = probe;
    return effect.active(values);
}

std::vector<Amplitude> amplitudes_of(const Effect& effect) {
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

bool changes_angle_only(const Effect& effect) {
    const effects::Changes changes = effect.changes();
    if (!changes.angle || changes.threshold || changes.coupling_phase) return false;
    effects::Values values = values_at_rest(effect);
    for (const Amplitude& amplitude : amplitudes_of(effect)) values.at(std::string(amplitude.value->name)) = probe;
    return configured(effect, values) == gyro::Setup{};
}

bool told_by_other_columns(const Effect& effect) {
    const Configures configures = configured_by(effect);
    return configures.dither_shape || configures.reading;
}

bool changes_reading(const Effect& effect) { return configured_by(effect).reading; }

bool is_of_coupling(const Effect& effect) {
    return !effect.adds_angle() && !is_random_rate(effect) && !told_by_other_columns(effect);
}

const EffectRoles& effect_roles() {
    static const EffectRoles roles = find_roles();
    return roles;
}

}  // namespace ringlock::closure
