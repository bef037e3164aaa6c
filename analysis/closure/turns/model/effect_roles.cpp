#include "analysis/closure/turns/model/effect_roles.hpp"

namespace ringlock::closure {

namespace {

using effects::Effect;
using effects::Role;

/// The parameter that changes this constant by itself; empty if none does.
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

bool estimated_from_other_columns(const Effect& effect) {
    const Configures configures = configured_by(effect);
    return configures.dither_shape || configures.reading;
}

bool is_fitted_in_phase(const effects::Effect& effect, effects::Role role) {
    using effects::Role;
    return (role == Role::size || role == Role::phase || role == Role::time || role == Role::frequency) &&
           !estimated_from_other_columns(effect);
}

bool changes_reading(const Effect& effect) { return configured_by(effect).reading; }

bool is_of_coupling(const Effect& effect) {
    const effects::Changes changes = effect.changes();
    return changes.threshold || changes.coupling_phase || configured_by(effect).coupling;
}

const EffectRoles& effect_roles() {
    static const EffectRoles roles = find_roles();
    return roles;
}

}  // namespace ringlock::closure
