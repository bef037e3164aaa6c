#include <array>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array dither_asymmetry_parameters = {
    Parameter{"ratio", 0.0, -0.5, 0.5, Role::size, "positive half cycles stronger by it, and shorter"},
};

class DitherAsymmetry final : public Effect {
   public:
    std::string_view name() const override { return "dither_asymmetry"; }
    std::string_view summary() const override {
        return "Half cycles of unequal strength, in addition to the spread over the gyros "
               "by ensemble.dither_asymmetry_sd_ratio.";
    }
    std::string_view advice() const override {
        return "Check the spring and the drive of the dither for a bias, and let the compensator take the acceleration "
               "of each half cycle by itself.";
    }
    std::string_view equation() const override {
        return "Peak rate Omega_D (1 + ratio) in positive and Omega_D (1 - ratio) in negative half cycles; "
               "the stronger are shorter, so that the dither angle stays bounded.";
    }
    std::span<const Parameter> parameters() const override { return dither_asymmetry_parameters; }
    bool active(const Values& values) const override { return values.at("ratio") != 0.0; }
    void configure(const Values& values, gyro::Setup& setup) const override {
        setup.dither_asymmetry_ratio += values.at("ratio");
    }
};

}  // namespace

const Effect& dither_asymmetry() {
    static const DitherAsymmetry effect;
    return effect;
}

}  // namespace ringlock::effects
