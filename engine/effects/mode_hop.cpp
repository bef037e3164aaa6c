#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

// Typical sizes are assumed orders of magnitude: the backscattered waves add up with other phases, half a radian apart,
// to a sum that differs by a tenth, and the bias steps by a good part of a degree an hour.
constexpr std::array mode_hop_parameters = {
    Parameter{"step_deg_h", 0.0, -1e4, 1e4, Role::size, "change of the bias", 0.8},
    Parameter{"threshold_ratio", 0.0, -0.9, 0.9, Role::size, "change of the lock-in threshold, over the threshold",
              0.12},
    Parameter{"phase_rad", 0.0, -units::pi, units::pi, Role::size, "change of the coupling's phase", 0.5},
    Parameter{"time_s", 0.0, 0.0, 1e9, Role::time, "when it happens, from the start"},
};

class ModeHop final : public Effect {
   public:
    std::string_view name() const override { return "mode_hop"; }
    std::string_view summary() const override {
        return "The laser hops to another longitudinal mode: "
               "bias, threshold and phase of the coupling step at one time.";
    }
    std::string_view advice() const override {
        return "Look at the path-length control and the temperature at this time: its range ended there, "
               "or a reset was due.";
    }
    std::string_view equation() const override {
        return "For t >= time: rate = step, threshold Omega_L (1 + threshold_ratio), coupling b F(psi + phase), "
               "since backscatter depends on wavelength and path (Aronowitz, \"Fundamentals of the Ring Laser Gyro\", "
               "in Optical Gyros and their Application, RTO AGARDograph 339, 1999). "
               "Threshold and phase change with the half cycle whose middle comes first after the time.";
    }
    std::span<const Parameter> parameters() const override { return mode_hop_parameters; }
    bool active(const Values& values) const override {
        return values.at("step_deg_h") != 0.0 || values.at("threshold_ratio") != 0.0 || values.at("phase_rad") != 0.0;
    }
    Changes changes() const override { return {.angle = true, .threshold = true, .coupling_phase = true}; }
    Follows follows() const override { return Follows::time; }
    ChangeOver change(const Values& values) const override {
        return [step_deg_h = values.at("step_deg_h"), ratio = values.at("threshold_ratio"),
                phase_rad = values.at("phase_rad"), time_s = values.at("time_s")](const Interval& at) {
            Change change;
            change.angle_arcsec = step_deg_h * std::clamp(at.start_s + at.duration_s - time_s, 0.0, at.duration_s);
            if (at.start_s + 0.5 * at.duration_s >= time_s) {
                change.threshold_factor = 1.0 + ratio;
                change.coupling_phase_rad = phase_rad;
            }
            return change;
        };
    }
    Bounds bounds(const Values& values, const Exposure& /*exposure*/) const override {
        return {.rate_deg_h = std::abs(values.at("step_deg_h")),
                .threshold_relative = std::abs(values.at("threshold_ratio")),
                .coupling_phase_rad = std::abs(values.at("phase_rad"))};
    }
};

}  // namespace

const Effect& mode_hop() {
    static const ModeHop effect;
    return effect;
}

}  // namespace ringlock::effects
