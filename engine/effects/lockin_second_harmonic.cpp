#include <array>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array lockin_second_harmonic_parameters = {
    Parameter{"ratio", 0.0, -0.5, 0.5, Role::size, "coupling at twice the phase over that at the phase itself"},
    Parameter{"phase_rad", 0.0, -units::pi, units::pi, Role::phase,
              "phase of the second harmonic against the sine detector"},
};

class LockinSecondHarmonic final : public Effect {
   public:
    std::string_view name() const override { return "lockin_second_harmonic"; }
    std::string_view summary() const override { return "The coupling of the beams has a second harmonic."; }
    std::string_view advice() const override {
        return "Let the compensator fit the second harmonic of the coupling, "
               "and look for a second scatterer or a reflection into the beam.";
    }
    std::string_view equation() const override {
        return "psi' = C (rate + dither rate) + b sin(psi) + ratio b sin(2 psi + phase), psi as the detectors see it; "
               "the kick of a turn at the second harmonic is ratio/sqrt(2) of that at the first "
               "(docs/dev/turn-map.md).";
    }
    std::span<const Parameter> parameters() const override { return lockin_second_harmonic_parameters; }
    bool active(const Values& values) const override { return values.at("ratio") != 0.0; }
    void configure(const Values& values, gyro::Setup& setup) const override {
        setup.lockin_second_ratio = values.at("ratio");
        setup.lockin_second_phase_rad = values.at("phase_rad");
    }
};

}  // namespace

const Effect& lockin_second_harmonic() {
    static const LockinSecondHarmonic effect;
    return effect;
}

}  // namespace ringlock::effects
