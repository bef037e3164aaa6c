#include <algorithm>
#include <array>
#include <cmath>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array bias_step_parameters = {
    Parameter{"step_deg_h", 0.0, -1e4, 1e4, Role::size, "change of the rate"},
    Parameter{"time_s", 0.0, 0.0, 1e9, Role::time, "when it happens, from the start"},
};

class BiasStep final : public Effect {
   public:
    std::string_view name() const override { return "bias_step"; }
    std::string_view summary() const override { return "A step of the bias at a known time."; }
    std::string_view advice() const override {
        return "Look at the log of the test bench at this time (supply, path-length control, "
               "handling), and repeat the record to see whether a step returns.";
    }
    std::string_view equation() const override { return "rate = step for t >= time, else 0."; }
    Follows follows() const override { return Follows::time; }
    std::span<const Parameter> parameters() const override { return bias_step_parameters; }
    bool active(const Values& values) const override { return values.at("step_deg_h") != 0.0; }
    Changes changes() const override { return {.angle = true}; }
    ChangeOver change(const Values& values) const override {
        return [step_deg_h = values.at("step_deg_h"), time_s = values.at("time_s")](const Interval& at) {
            return Change{.angle_arcsec =
                              step_deg_h * std::clamp(at.start_s + at.duration_s - time_s, 0.0, at.duration_s)};
        };
    }
    Bounds bounds(const Values& values, const Exposure& /*exposure*/) const override {
        return {.rate_deg_h = std::abs(values.at("step_deg_h"))};
    }
};

}  // namespace

const Effect& bias_step() {
    static const BiasStep effect;
    return effect;
}

}  // namespace ringlock::effects
