#include <array>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array detector_phase_offset_parameters = {
    Parameter{"phase_rad", 0.0, -units::pi, units::pi, Role::phase, "phase of the coupling against the sine detector"},
};

class DetectorPhaseOffset final : public Effect {
   public:
    std::string_view name() const override { return "detector_phase_offset"; }
    std::string_view summary() const override {
        return "The coupling acts at another phase than the one the detectors see.";
    }
    std::string_view advice() const override {
        return "Give the compensator this phase, or align the detectors with the fringes anew: "
               "with an offset it removes only the cosine of the phase from each kick.";
    }
    std::string_view equation() const override {
        return "psi' = C (rate + dither rate) + b sin(psi + phase), psi as the detectors see it (Gao and Deng 2007, "
               "equation 1, with a phase).";
    }
    std::span<const Parameter> parameters() const override { return detector_phase_offset_parameters; }
    bool active(const Values& values) const override { return values.at("phase_rad") != 0.0; }
    void configure(const Values& values, gyro::Setup& setup) const override {
        setup.coupling_phase_rad = values.at("phase_rad");
    }
};

}  // namespace

const Effect& detector_phase_offset() {
    static const DetectorPhaseOffset effect;
    return effect;
}

}  // namespace ringlock::effects
