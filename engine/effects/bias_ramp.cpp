#include <array>
#include <cmath>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array bias_ramp_parameters = {
    Parameter{"deg_h_per_h", 0.0, -1e5, 1e5, Role::size, "slope R of the rate"},
};

class BiasRamp final : public Effect {
   public:
    std::string_view name() const override { return "bias_ramp"; }
    std::string_view summary() const override { return "A bias that grows linearly in time, from zero at the start."; }
    std::string_view advice() const override {
        return "Repeat the record after a warm-up of several hours, with the temperature recorded: "
               "a ramp that follows the temperature belongs in the model of the temperature.";
    }
    std::string_view equation() const override {
        return "rate = R t; Allan deviation R tau / sqrt(2) (IEEE Std 952-1997, annex C, rate ramp).";
    }
    Follows follows() const override { return Follows::time; }
    std::span<const Parameter> parameters() const override { return bias_ramp_parameters; }
    bool active(const Values& values) const override { return values.at("deg_h_per_h") != 0.0; }
    Changes changes() const override { return {.angle = true}; }
    ChangeOver change(const Values& values) const override {
        return [slope_arcsec_s2 = values.at("deg_h_per_h") / 3600.0](const Interval& at) {
            return Change{.angle_arcsec = slope_arcsec_s2 * (at.start_s + 0.5 * at.duration_s) * at.duration_s};
        };
    }
    Bounds bounds(const Values& values, const Exposure& exposure) const override {
        const double slope = std::abs(values.at("deg_h_per_h"));
        return {.rate_deg_h = slope * exposure.duration_h, .rate_slope_deg_h_s = slope / 3600.0};
    }
};

}  // namespace

const Effect& bias_ramp() {
    static const BiasRamp effect;
    return effect;
}

}  // namespace ringlock::effects
