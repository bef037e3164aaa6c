#include <array>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array lockin_turn_asymmetry_parameters = {
    Parameter{"ratio", 0.0, -0.9, 0.9, Role::size, "threshold stronger by it at minima of the phase, weaker at maxima"},
};

class LockinTurnAsymmetry final : public Effect {
   public:
    std::string_view name() const override { return "lockin_turn_asymmetry"; }
    std::string_view summary() const override {
        return "The lock-in threshold differs between the turns of the dither.";
    }
    std::string_view advice() const override {
        return "Let the compensator take a threshold of its own for minima and maxima, "
               "and look for a bending of the block at the ends of the swing.";
    }
    std::string_view equation() const override {
        return "Threshold Omega_L (1 + ratio cos(w t)), t from a minimum of the phase on: "
               "where the dither bends the path of the beams, the light scattered back depends on the dither angle.";
    }
    std::span<const Parameter> parameters() const override { return lockin_turn_asymmetry_parameters; }
    bool active(const Values& values) const override { return values.at("ratio") != 0.0; }
    void configure(const Values& values, gyro::Setup& setup) const override {
        setup.lockin_turn_asymmetry = values.at("ratio");
    }
};

}  // namespace

const Effect& lockin_turn_asymmetry() {
    static const LockinTurnAsymmetry effect;
    return effect;
}

}  // namespace ringlock::effects
