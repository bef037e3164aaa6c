#include <array>
#include <cmath>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array scale_factor_error_parameters = {
    Parameter{"relative", 0.0, -0.1, 0.1, Role::size, "output angle per input angle, less one"},
};

class ScaleFactorError final : public Effect {
   public:
    std::string_view name() const override { return "scale_factor_error"; }
    std::string_view summary() const override { return "The gyro puts out more angle than it is turned by."; }
    std::string_view advice() const override {
        return "Calibrate the scale factor on a rate table at several rates of either sign; "
               "its error follows the input of the record alone.";
    }
    /// The light counts C (1 + relative) for C. In the output of the input rate this leaves an error of `relative`
    /// times the angle. Every swing of the dither becomes longer by the same factor, which is equivalent to a dither of
    /// another amplitude: at the minima of the dither angle, where the output is taken, the swings cancel.
    std::string_view equation() const override {
        return "rate = relative times the input rate. The swings of the dither grow as well, but cancel "
               "over each cycle: that is a larger dither.peak_rate_deg_s and is left to that key (docs/effects.md).";
    }
    Follows follows() const override { return Follows::input_rate; }
    std::span<const Parameter> parameters() const override { return scale_factor_error_parameters; }
    bool active(const Values& values) const override { return values.at("relative") != 0.0; }
    Changes changes() const override { return {.angle = true}; }
    ChangeOver change(const Values& values) const override {
        return [relative = values.at("relative")](const Interval& at) {
            const double mean_rate_arcsec_s = 0.5 * (at.input_rate_deg_h[0] + at.input_rate_deg_h[1]);
            return Change{.angle_arcsec = relative * mean_rate_arcsec_s * at.duration_s};
        };
    }
    Bounds bounds(const Values& values, const Exposure& exposure) const override {
        const double size = std::abs(values.at("relative"));
        return {.rate_deg_h = size * exposure.input_rate_deg_h,
                .rate_slope_deg_h_s = size * exposure.input_slope_deg_h_s};
    }
};

}  // namespace

const Effect& scale_factor_error() {
    static const ScaleFactorError effect;
    return effect;
}

}  // namespace ringlock::effects
