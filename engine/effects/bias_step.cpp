#include <algorithm>
#include <array>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array parameters_of = {
    Parameter{"step_deg_h", 0.0, -1e4, 1e4, "change of the rate"},
    Parameter{"time_s", 0.0, 0.0, 1e9, "when it happens, from the start"},
};

class Process final : public RateProcess {
   public:
    Process(double step_deg_h, double time_s) : step_arcsec_s_(step_deg_h), time_s_(time_s) {}

    double angle_arcsec(double start_s, double duration_s) override {
        return step_arcsec_s_ * std::clamp(start_s + duration_s - time_s_, 0.0, duration_s);
    }

   private:
    double step_arcsec_s_;
    double time_s_;
};

class BiasStep final : public Effect {
   public:
    std::string_view name() const override { return "bias_step"; }
    std::string_view summary() const override { return "A step of the bias at a known time."; }
    std::string_view equation() const override { return "rate = step for t >= time, else 0."; }
    std::span<const Parameter> parameters() const override { return parameters_of; }
    bool active(const Values& values) const override { return values.at("step_deg_h") != 0.0; }
    std::unique_ptr<RateProcess> rate_process(const Values& values, const random::Identity& /*who*/) const override {
        return std::make_unique<Process>(values.at("step_deg_h"), values.at("time_s"));
    }
};

}  // namespace

const Effect& bias_step() {
    static const BiasStep effect;
    return effect;
}

}  // namespace ringlock::effects
