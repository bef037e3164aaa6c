#include <array>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array parameters_of = {
    Parameter{"frequency_hz", 10.0, 1e-6, 1e5, "frequency of the line"},
    Parameter{"rate_deg_h", 0.0, 0.0, 1e4, "amplitude of the rate"},
    Parameter{"phase_rad", 0.0, -units::two_pi, units::two_pi, "phase of the rate at the start"},
};

class Process final : public RateProcess {
   public:
    Process(double frequency_hz, double rate_deg_h, double phase_rad)
        : frequency_hz_(frequency_hz), rate_arcsec_s_(rate_deg_h), phase_rad_(phase_rad) {}

    /// A sum of cosines would lose digits late in a long run; the product over the middle of the interval does not.
    double angle_arcsec(double start_s, double duration_s) override {
        const double turns = frequency_hz_ * (start_s + 0.5 * duration_s);
        const double half_angle = units::pi * frequency_hz_ * duration_s;
        return rate_arcsec_s_ / (units::pi * frequency_hz_) * std::sin(half_angle) *
               std::sin(units::two_pi * (turns - std::floor(turns)) + phase_rad_);
    }

   private:
    double frequency_hz_;
    double rate_arcsec_s_;
    double phase_rad_;
};

class BaseVibration final : public Effect {
   public:
    std::string_view name() const override { return "base_vibration"; }
    std::string_view summary() const override { return "A line in the input rate, from a base that vibrates."; }
    std::string_view equation() const override {
        return "rate = A sin(2 pi f t + phase), integrated exactly over each interval.";
    }
    std::span<const Parameter> parameters() const override { return parameters_of; }
    bool active(const Values& values) const override { return values.at("rate_deg_h") != 0.0; }
    std::unique_ptr<RateProcess> rate_process(const Values& values, const random::Identity& /*who*/) const override {
        return std::make_unique<Process>(values.at("frequency_hz"), values.at("rate_deg_h"), values.at("phase_rad"));
    }
};

}  // namespace

const Effect& base_vibration() {
    static const BaseVibration effect;
    return effect;
}

}  // namespace ringlock::effects
