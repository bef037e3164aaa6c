#include <array>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array parameters_of = {
    Parameter{"relative_per_k", 0.0, -0.5, 0.5, Role::size, "relative change of the threshold with each kelvin"},
};

class LockinTemperature final : public Effect {
   public:
    std::string_view name() const override { return "lockin_temperature"; }
    std::string_view summary() const override {
        return "The lock-in threshold follows the temperature of section [environment].";
    }
    std::string_view equation() const override {
        return "Threshold Omega_L (1 + relative_per_k dT), dT the temperature less that at the start; constant over "
               "each "
               "half cycle.";
    }
    Follows follows() const override { return Follows::temperature; }
    std::span<const Parameter> parameters() const override { return parameters_of; }
    bool active(const Values& values) const override { return values.at("relative_per_k") != 0.0; }
    double threshold_factor(const Values& values, double temperature_change_k) const override {
        return 1.0 + values.at("relative_per_k") * temperature_change_k;
    }
};

}  // namespace

const Effect& lockin_temperature() {
    static const LockinTemperature effect;
    return effect;
}

}  // namespace ringlock::effects
