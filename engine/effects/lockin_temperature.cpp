#include <array>
#include <cmath>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array lockin_temperature_parameters = {
    Parameter{"relative_per_k", 0.0, -0.5, 0.5, Role::size, "relative change of the threshold with each kelvin"},
};

class LockinTemperature final : public Effect {
   public:
    std::string_view name() const override { return "lockin_temperature"; }
    std::string_view summary() const override {
        return "The lock-in threshold follows the temperature of section [environment].";
    }
    std::string_view advice() const override {
        return "Calibrate the lock-in threshold over the range of temperatures, "
               "and let the compensator follow the thermometer.";
    }
    std::string_view equation() const override {
        return "Threshold Omega_L (1 + relative_per_k dT), dT the temperature less that at the start; "
               "constant over each half cycle.";
    }
    Follows follows() const override { return Follows::temperature; }
    std::span<const Parameter> parameters() const override { return lockin_temperature_parameters; }
    bool active(const Values& values) const override { return values.at("relative_per_k") != 0.0; }
    Changes changes() const override { return {.threshold = true}; }
    ChangeOver change(const Values& values) const override {
        return [relative_per_k = values.at("relative_per_k")](const Interval& at) {
            const double mean_change_k = 0.5 * (at.temperature_change_k[0] + at.temperature_change_k[1]);
            return Change{.threshold_factor = 1.0 + relative_per_k * mean_change_k};
        };
    }
    Bounds bounds(const Values& values, const Exposure& exposure) const override {
        return {.threshold_relative = std::abs(values.at("relative_per_k")) * exposure.temperature_change_k};
    }
};

}  // namespace

const Effect& lockin_temperature() {
    static const LockinTemperature effect;
    return effect;
}

}  // namespace ringlock::effects
