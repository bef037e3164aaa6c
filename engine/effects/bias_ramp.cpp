#include <array>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array parameters_of = {
    Parameter{"deg_h_per_h", 0.0, -1000.0, 1000.0, "slope R of the rate"},
};

class Process final : public RateProcess {
   public:
    explicit Process(double deg_h_per_h) : slope_arcsec_s2_(deg_h_per_h / 3600.0) {}

    double angle_arcsec(double start_s, double duration_s) override {
        return slope_arcsec_s2_ * (start_s + 0.5 * duration_s) * duration_s;
    }

   private:
    double slope_arcsec_s2_;
};

class BiasRamp final : public Effect {
   public:
    std::string_view name() const override { return "bias_ramp"; }
    std::string_view summary() const override { return "A bias that grows linearly in time, from zero at the start."; }
    std::string_view equation() const override {
        return "rate = R t; Allan deviation R tau / sqrt(2) (IEEE Std 952-1997, annex C, rate ramp).";
    }
    std::span<const Parameter> parameters() const override { return parameters_of; }
    bool active(const Values& values) const override { return values.at("deg_h_per_h") != 0.0; }
    std::unique_ptr<RateProcess> rate_process(const Values& values, const random::Identity& /*who*/) const override {
        return std::make_unique<Process>(values.at("deg_h_per_h"));
    }
};

}  // namespace

const Effect& bias_ramp() {
    static const BiasRamp effect;
    return effect;
}

}  // namespace ringlock::effects
