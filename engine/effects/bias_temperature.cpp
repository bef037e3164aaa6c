#include <array>
#include <cmath>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array bias_temperature_parameters = {
    Parameter{"deg_h_per_k", 0.0, -100.0, 100.0, Role::size, "change of the bias with each kelvin"},
};

class BiasTemperature final : public Effect {
   public:
    std::string_view name() const override { return "bias_temperature"; }
    std::string_view summary() const override {
        return "A bias that follows the temperature of section [environment].";
    }
    std::string_view advice() const override {
        return "Calibrate the bias over the range of temperatures, in both directions, "
               "and compensate it by the thermometer nearest to the block.";
    }
    std::string_view equation() const override {
        return "rate = deg_h_per_k dT, dT the temperature less that at the start; "
               "the temperature is linear over each half cycle.";
    }
    Follows follows() const override { return Follows::temperature; }
    std::span<const Parameter> parameters() const override { return bias_temperature_parameters; }
    bool active(const Values& values) const override { return values.at("deg_h_per_k") != 0.0; }
    Changes changes() const override { return {.angle = true}; }
    ChangeOver change(const Values& values) const override {
        return [deg_h_per_k = values.at("deg_h_per_k")](const Interval& at) {
            const double mean_change_k = 0.5 * (at.temperature_change_k[0] + at.temperature_change_k[1]);
            return Change{.angle_arcsec = deg_h_per_k * mean_change_k * at.duration_s};
        };
    }
    Bounds bounds(const Values& values, const Exposure& exposure) const override {
        const double size = std::abs(values.at("deg_h_per_k"));
        return {.rate_deg_h = size * exposure.temperature_change_k,
                .rate_slope_deg_h_s = size * exposure.temperature_slope_k_per_h / 3600.0};
    }
};

}  // namespace

const Effect& bias_temperature() {
    static const BiasTemperature effect;
    return effect;
}

}  // namespace ringlock::effects
