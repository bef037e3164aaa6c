#include <fmt/format.h>

#include <array>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

Finding effects_leave_a_threshold(const Scenario& s) {
    constexpr double most = 0.9;
    const double change = threshold_change_relative(s);
    if (change <= most) return {};
    std::vector<std::string> keys;
    for (const EffectBounds& bounds : bounds_of_effects(s)) {
        if (bounds.certain.threshold_relative == 0.0) continue;
        for (std::string& key : keys_of(*bounds.effect)) keys.push_back(std::move(key));
    }
    keys.insert(keys.end(), {"environment.temperature_ramp_k_per_h", "environment.temperature_swing_k",
                             "environment.profile_temperature_k", "ensemble.duration_s", "ensemble.settle_s"});
    return Complaint{std::move(keys),
                     fmt::format("the temperature changes by up to {:g} K, the threshold by {:g} of itself; "
                                 "it must not change by more than {:g}",
                                 exposure(s).temperature_change_k, change, most)};
}

constexpr std::array all_lockin_rules = {
    Rule{"Effects change the lock-in threshold by no more than 0.9 of itself over the run.", effects_leave_a_threshold},
};

}  // namespace

std::span<const Rule> lockin_rules() { return all_lockin_rules; }

}  // namespace ringlock::scenario
