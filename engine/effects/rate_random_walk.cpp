#include <array>
#include <cmath>
#include <numbers>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array rate_random_walk_parameters = {
    Parameter{"deg_h_rt_h", 0.0, 0.0, 1000.0, Role::deviation,
              "rate random walk K: rms change of the rate after one hour"},
};

/// The rate r is a Wiener process. Over dt its change and the angle beyond r dt are jointly normal:
/// var(dr) = K^2 dt, var(angle) = K^2 dt^3 / 3, cov = K^2 dt^2 / 2.
class RateRandomWalkProcess final : public RateProcess {
   public:
    RateRandomWalkProcess(double deg_h_rt_h, const random::Identity& who)
        // (deg/h)/sqrt(h) = (arcsec/s)/sqrt(3600 s)
        : arcsec_s_rt_s_(deg_h_rt_h / 60.0), normal_(who, random::Purpose::rate_random_walk) {}

    double angle_arcsec(double /*start_s*/, double duration_s) override {
        const double change = arcsec_s_rt_s_ * std::sqrt(duration_s) * normal_();
        // Given both ends the mean rate is their average; the bridge between them adds variance K^2 dt^3 / 12.
        const double bridge = arcsec_s_rt_s_ * std::sqrt(duration_s) * normal_() * (0.5 / std::numbers::sqrt3);
        const double angle = (rate_arcsec_s_ + 0.5 * change + bridge) * duration_s;
        rate_arcsec_s_ += change;
        return angle;
    }

   private:
    double arcsec_s_rt_s_;
    double rate_arcsec_s_ = 0.0;
    random::NormalStream normal_;
};

class RateRandomWalk final : public Effect {
   public:
    std::string_view name() const override { return "rate_random_walk"; }
    std::string_view summary() const override { return "Rate that wanders as a random walk, from zero at the start."; }
    std::string_view advice() const override {
        return "Record for longer, at constant temperature, and look for a slow cause: pressure, supply, "
               "path-length control.";
    }
    std::string_view equation() const override {
        return "dr = K dW; Allan variance K^2 tau / 3 (IEEE Std 952-1997, annex C, rate random walk).";
    }
    std::span<const Parameter> parameters() const override { return rate_random_walk_parameters; }
    bool active(const Values& values) const override { return values.at("deg_h_rt_h") != 0.0; }
    RateNoise rate_noise(const Values& values) const override {
        const double deg_h_rt_s = values.at("deg_h_rt_h") / 60.0;
        return {.walk_deg2_h2_per_s = deg_h_rt_s * deg_h_rt_s};
    }
    std::unique_ptr<RateProcess> rate_process(const Values& values, const random::Identity& who) const override {
        return std::make_unique<RateRandomWalkProcess>(values.at("deg_h_rt_h"), who);
    }
};

}  // namespace

const Effect& rate_random_walk() {
    static const RateRandomWalk effect;
    return effect;
}

}  // namespace ringlock::effects
