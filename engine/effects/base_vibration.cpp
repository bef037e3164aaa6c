#include <array>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array base_vibration_parameters = {
    Parameter{"frequency_hz", 10.0, 1e-6, 1e5, Role::frequency, "frequency of the line"},
    Parameter{"rate_deg_h", 0.0, 0.0, 1e4, Role::size, "amplitude of the rate"},
    Parameter{"phase_rad", 0.0, -units::two_pi, units::two_pi, Role::phase, "phase of the rate at the start"},
};

class BaseVibration final : public Effect {
   public:
    std::string_view name() const override { return "base_vibration"; }
    std::string_view summary() const override { return "A line in the input rate, from a base that vibrates."; }
    std::string_view advice() const override {
        return "Measure the rotation of the base at this frequency with the gyro at rest, "
               "on another table or on isolators: a line that stays is the gyro's own.";
    }
    std::string_view equation() const override {
        return "rate = A sin(2 pi f t + phase), integrated exactly over each interval.";
    }
    std::span<const Parameter> parameters() const override { return base_vibration_parameters; }
    bool active(const Values& values) const override { return values.at("rate_deg_h") != 0.0; }
    Changes changes() const override { return {.angle = true}; }
    /// A difference of cosines would lose digits late in a long run; the product over the middle of the interval does
    /// not.
    ChangeOver change(const Values& values) const override {
        return [frequency_hz = values.at("frequency_hz"), rate_deg_h = values.at("rate_deg_h"),
                phase_rad = values.at("phase_rad")](const Interval& at) {
            const double turns = frequency_hz * (at.start_s + 0.5 * at.duration_s);
            const double half_angle = units::pi * frequency_hz * at.duration_s;
            return Change{.angle_arcsec = rate_deg_h / (units::pi * frequency_hz) * std::sin(half_angle) *
                                          std::sin(units::two_pi * (turns - std::floor(turns)) + phase_rad)};
        };
    }
    Bounds bounds(const Values& values, const Exposure& /*exposure*/) const override {
        const double rate = std::abs(values.at("rate_deg_h"));
        return {.rate_deg_h = rate, .rate_slope_deg_h_s = rate * units::two_pi * values.at("frequency_hz")};
    }
};

}  // namespace

const Effect& base_vibration() {
    static const BaseVibration effect;
    return effect;
}

}  // namespace ringlock::effects
