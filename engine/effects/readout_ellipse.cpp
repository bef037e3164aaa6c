#include <array>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array readout_ellipse_parameters = {
    Parameter{"gain", 0.0, -0.5, 0.5, Role::size, "relative gain error of the sine detector"},
    Parameter{"offset_sin", 0.0, -0.5, 0.5, Role::size, "offset of the sine detector, in fringe amplitudes"},
    Parameter{"offset_cos", 0.0, -0.5, 0.5, Role::size, "offset of the cosine detector, in fringe amplitudes"},
    Parameter{"orthogonality_rad", 0.0, -0.7, 0.7, Role::size, "how far the cosine detector is out of quadrature"},
};

class ReadoutEllipse final : public Effect {
   public:
    std::string_view name() const override { return "readout_ellipse"; }
    std::string_view summary() const override {
        return "The quadrature detectors trace an ellipse in place of a circle.";
    }
    std::string_view advice() const override {
        return "Fit the ellipse of the detectors before the phase is taken from them, and correct gains, "
               "offsets and their phase.";
    }
    std::string_view equation() const override {
        return "sin = (1 + gain) sin(psi) + offset_sin, cos = cos(psi + orthogonality) + offset_cos (Heydemann, "
               "Applied Optics 20, 3382, 1981, with the sine as the reference).";
    }
    std::span<const Parameter> parameters() const override { return readout_ellipse_parameters; }
    bool active(const Values& values) const override {
        return values.at("gain") != 0.0 || values.at("offset_sin") != 0.0 || values.at("offset_cos") != 0.0 ||
               values.at("orthogonality_rad") != 0.0;
    }
    void configure(const Values& values, gyro::Setup& setup) const override {
        setup.ellipse.gain = values.at("gain");
        setup.ellipse.offset_sin = values.at("offset_sin");
        setup.ellipse.offset_cos = values.at("offset_cos");
        setup.ellipse.orthogonality_rad = values.at("orthogonality_rad");
    }
};

}  // namespace

const Effect& readout_ellipse() {
    static const ReadoutEllipse effect;
    return effect;
}

}  // namespace ringlock::effects
