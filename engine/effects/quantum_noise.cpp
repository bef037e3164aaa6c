#include <array>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array quantum_noise_parameters = {
    Parameter{"deg_rt_h", 1e-4, 0.0, 10.0, Role::deviation, "angle random walk of the quantum noise floor"},
};

class QuantumNoiseProcess final : public RateProcess {
   public:
    QuantumNoiseProcess(double deg_rt_h, const random::Identity& who)
        : arcsec_rt_s_(deg_rt_h / units::deg_rt_h_per_arcsec_rt_s), who_(who) {}

    double angle_arcsec(double /*start_s*/, double duration_s) override {
        return arcsec_rt_s_ * std::sqrt(duration_s) * random::normal(who_, random::Purpose::quantum_noise, interval_++);
    }

   private:
    double arcsec_rt_s_;
    random::Identity who_;
    std::uint64_t interval_ = 0;
};

/// Every half cycle of every gyro of a study takes one: all gyros at once.
class QuantumNoiseLaneProcess final : public LaneRateProcess {
   public:
    QuantumNoiseLaneProcess(double deg_rt_h, const random::LaneIdentities& who)
        : arcsec_rt_s_(deg_rt_h / units::deg_rt_h_per_arcsec_rt_s), who_(who) {}

    void add_angles(const LaneIntervals& intervals, std::span<simd::Lanes> angle_arcsec) override {
        deviates_.resize(angle_arcsec.size());
        random::normals(who_, random::Purpose::quantum_noise, intervals.first, deviates_.size(), intervals.lanes,
                        deviates_.front().data());
        for (std::size_t i = 0; i < angle_arcsec.size(); ++i) {
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                angle_arcsec[i][lane] += arcsec_rt_s_ * std::sqrt(intervals.duration_s[i][lane]) * deviates_[i][lane];
            }
        }
    }

   private:
    double arcsec_rt_s_;
    random::LaneIdentities who_;
    std::vector<simd::Lanes> deviates_;
};

class QuantumNoise final : public Effect {
   public:
    std::string_view name() const override { return "quantum_noise"; }
    std::string_view summary() const override {
        return "White rate noise of spontaneous emission, independent of the phase at the turns: "
               "the floor under every arm.";
    }
    std::string_view advice() const override {
        return "Raise the power of the laser or lower the losses: no dither and no compensation lowers this noise; "
               "it is the floor of every arm.";
    }
    std::string_view equation() const override {
        return "The angle gained in an interval dt is normal with variance N^2 dt and independent from interval "
               "to interval (IEEE Std 952-1997, annex C, angle random walk).";
    }
    std::span<const Parameter> parameters() const override { return quantum_noise_parameters; }
    bool active(const Values& values) const override { return values.at("deg_rt_h") != 0.0; }
    RateNoise rate_noise(const Values& values) const override {
        const double arcsec_rt_s = values.at("deg_rt_h") / units::deg_rt_h_per_arcsec_rt_s;
        return {.white_deg2_h2_s = arcsec_rt_s * arcsec_rt_s};
    }
    std::unique_ptr<RateProcess> rate_process(const Values& values, const random::Identity& who) const override {
        return std::make_unique<QuantumNoiseProcess>(values.at("deg_rt_h"), who);
    }
    std::unique_ptr<LaneRateProcess> lane_rate_process(const Values& values, const random::LaneIdentities& who,
                                                       std::size_t /*lanes*/) const override {
        return std::make_unique<QuantumNoiseLaneProcess>(values.at("deg_rt_h"), who);
    }
};

}  // namespace

const Effect& quantum_noise() {
    static const QuantumNoise effect;
    return effect;
}

}  // namespace ringlock::effects
