#include "analysis/closure/decide/evidence.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"

namespace ringlock::closure {

int count_of(const effects::Effect& effect, std::initializer_list<effects::Role> roles) {
    const auto parameters = effect.parameters();
    return static_cast<int>(std::count_if(parameters.begin(), parameters.end(), [&](const auto& parameter) {
        return std::find(roles.begin(), roles.end(), parameter.role) != roles.end();
    }));
}

bool is_random_rate(const effects::Effect& effect) {
    return effects::first_of(effect, effects::Role::deviation) != nullptr;
}

double cost_of_choice() { return std::log(static_cast<double>(effects::registry().size())); }

double level_of_one_effect() { return options.level_of_effects / static_cast<double>(effects::registry().size()); }

bool passes(double p_value) { return p_value < level_of_one_effect(); }

double p_of_gain(double gain, const effects::Effect& effect) {
    using effects::Role;
    const int free =
        count_of(effect, {Role::size, Role::phase, Role::time, Role::frequency, Role::deviation, Role::probability});
    return chi2_tail(2.0 * gain, free);
}

std::optional<double> evidence_for_addition(const effects::Effect& larger, const effects::Effect& smaller,
                                            const std::vector<Estimate>& fitted, double log_likelihood_ratio) {
    const auto estimate = [&](const effects::Parameter& parameter) {
        const auto found = std::find_if(fitted.begin(), fitted.end(), [&](const Estimate& e) {
            return e.effect == larger.name() && e.name == parameter.name;
        });
        return found == fitted.end() ? nullptr : &*found;
    };
    const std::vector<Amplitude> additional = in_addition(larger, smaller);
    // The scale of the effect: the sum of squares of the sizes that both effects have, in units of their typical sizes.
    double squares = 0.0;
    for (const Amplitude& amplitude : amplitudes_of(larger)) {
        const effects::Parameter& parameter = *amplitude.value;
        const bool common = std::none_of(additional.begin(), additional.end(),
                                         [&](const Amplitude& a) { return a.value == amplitude.value; });
        const Estimate* found = estimate(parameter);
        if (parameter.typical == 0.0 || found == nullptr) return std::nullopt;
        if (common) squares += std::pow(found->value / parameter.typical, 2);
    }
    double evidence = 0.0;
    for (const Amplitude& amplitude : additional) {
        const Estimate& found = *estimate(*amplitude.value);
        // The record contains no information on a size that the fit could not determine.
        if (!(found.sd > 0.0) || !std::isfinite(found.sd)) continue;
        const double expected = squares * std::pow(amplitude.value->typical / found.sd, 2);
        const double shown = std::pow(found.value / found.sd, 2);
        evidence += 0.5 * (shown * expected / (1.0 + expected) - std::log1p(expected));
    }
    return std::min(evidence, log_likelihood_ratio);
}

}  // namespace ringlock::closure
