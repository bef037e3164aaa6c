#include "analysis/closure/decide/evidence.hpp"

#include <algorithm>
#include <cmath>

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

}  // namespace ringlock::closure
