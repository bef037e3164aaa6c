#include "engine/effects/effect.hpp"

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
