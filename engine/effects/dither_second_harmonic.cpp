#include <array>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array dither_second_harmonic_parameters = {
    Parameter{"ratio", 0.0, -0.3, 0.3, Role::size, "second harmonic of the dither rate over the first"},
    Parameter{"phase_rad", 0.0, -units::pi, units::pi, Role::phase, "phase of the second harmonic at the turns"},
};

class DitherSecondHarmonic final : public Effect {
   public:
    std::string_view name() const override { return "dither_second_harmonic"; }
    std::string_view summary() const override { return "The dither rate has a second harmonic."; }
    std::string_view advice() const override {
        return "Measure the motion of the block with its pickup over a cycle: a second harmonic comes from the drive "
               "or a spring that is not linear.";
    }
    std::string_view equation() const override {
        return "g = C rate + A w (s sin(w t) + ratio sin(2 w t + phase)), t from each turn of the dither on, "
               "s = +1 in positive and -1 in negative half cycles (docs/physics.md). "
               "Swings and turns of the dither angle stay where they are.";
    }
    std::span<const Parameter> parameters() const override { return dither_second_harmonic_parameters; }
    bool active(const Values& values) const override { return values.at("ratio") != 0.0; }
    void configure(const Values& values, gyro::Setup& setup) const override {
        setup.dither_harmonic_ratio = values.at("ratio");
        setup.dither_harmonic_phase_rad = values.at("phase_rad");
    }
};

}  // namespace

const Effect& dither_second_harmonic() {
    static const DitherSecondHarmonic effect;
    return effect;
}

}  // namespace ringlock::effects
