#include <array>
#include <cmath>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array null_shift_ramp_parameters = {
    Parameter{"deg_h_per_k_h", 0.0, -10.0, 10.0, Role::size, "bias for each kelvin an hour"},
};

class NullShiftRamp final : public Effect {
   public:
    std::string_view name() const override { return "null_shift_ramp"; }
    std::string_view summary() const override {
        return "A bias in proportion to the slope of the temperature of section [environment].";
    }
    std::string_view advice() const override {
        return "Repeat the record with a slower change of temperature: a bias in proportion to the slope halves "
               "with it, but a bias that follows the temperature does not.";
    }
    std::string_view equation() const override {
        return "rate = deg_h_per_k_h dT/dt, in K/h: gradients in the block are proportional "
               "to the temperature's slope and shift the null by the flow of the gas (IEEE Std 647-2006, "
               "thermal sensitivities of the bias). The angle is that coefficient times the change of the temperature.";
    }
    std::span<const Parameter> parameters() const override { return null_shift_ramp_parameters; }
    bool active(const Values& values) const override { return values.at("deg_h_per_k_h") != 0.0; }
    Changes changes() const override { return {.angle = true}; }
    Follows follows() const override { return Follows::temperature; }
    ChangeOver change(const Values& values) const override {
        // deg/h for each K/h is degrees for each kelvin.
        return [arcsec_per_k = 3600.0 * values.at("deg_h_per_k_h")](const Interval& at) {
            return Change{.angle_arcsec = arcsec_per_k * (at.temperature_change_k[1] - at.temperature_change_k[0])};
        };
    }
    Bounds bounds(const Values& values, const Exposure& exposure) const override {
        return {.rate_deg_h = std::abs(values.at("deg_h_per_k_h")) * exposure.temperature_slope_k_per_h};
    }
};

}  // namespace

const Effect& null_shift_ramp() {
    static const NullShiftRamp effect;
    return effect;
}

}  // namespace ringlock::effects
