#include "engine/effects/effect.hpp"

#include <cmath>
#include <utility>

namespace ringlock::effects {

namespace {

class OneByOne final : public LaneRateProcess {
   public:
    explicit OneByOne(std::vector<std::unique_ptr<RateProcess>> processes) : processes_(std::move(processes)) {}

    void add_angles(const LaneIntervals& intervals, std::span<simd::Lanes> angle_arcsec) override {
        for (std::size_t lane = 0; lane < processes_.size(); ++lane) {
            for (std::size_t i = 0; i < angle_arcsec.size(); ++i) {
                angle_arcsec[i][lane] +=
                    processes_[lane]->angle_arcsec(intervals.start_s[i][lane], intervals.duration_s[i][lane]);
            }
        }
    }

   private:
    std::vector<std::unique_ptr<RateProcess>> processes_;
};

}  // namespace

double angle_variance_arcsec2(const RateNoise& noise, double duration_s) {
    const double t = duration_s;
    double variance = (noise.white_deg2_h2_s + noise.walk_deg2_h2_per_s * t * t / 3.0) * t;
    for (const GaussMarkov& term : noise.terms) {
        // Twice the integral of (t - s) exp(-s/T) over s from 0 to t.
        const double x = t / term.time_s;
        const double bracket =
            x < 1e-2 ? x * x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0)))) : x + std::expm1(-x);
        variance += 2.0 * term.variance_deg2_h2 * term.time_s * term.time_s * bracket;
    }
    return variance;
}

double rate_sd_deg_h(const RateNoise& noise, double average_s, double duration_h) {
    double variance = noise.white_deg2_h2_s / average_s + noise.walk_deg2_h2_per_s * duration_h * 3600.0;
    for (const GaussMarkov& term : noise.terms) variance += term.variance_deg2_h2;
    return std::sqrt(variance);
}

std::unique_ptr<LaneRateProcess> Effect::lane_rate_process(const Values& values, const random::LaneIdentities& who,
                                                           std::size_t lanes) const {
    std::vector<std::unique_ptr<RateProcess>> processes;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
        processes.push_back(rate_process(values, {who.seed, who.gyro[lane]}));
        if (processes.back() == nullptr) return nullptr;
    }
    return std::make_unique<OneByOne>(std::move(processes));
}

}  // namespace ringlock::effects
