#include "engine/ensemble/added_angles.hpp"

#include "engine/ensemble/draw.hpp"

namespace ringlock::ensemble {

namespace {

class AddedAngles final : public effects::LaneRateProcess {
   public:
    AddedAngles(const effects::Effect& effect, const effects::Values& values, const scenario::Scenario& scenario,
                const std::vector<gyro::Setup>& setups)
        : added_angle_arcsec_(effect.added_angle(values)),
          scenario_(scenario),
          setups_(setups),
          temperature_varies_(scenario::temperature_varies(scenario.environment)) {}

    void add_angles(const effects::LaneIntervals& intervals, std::span<simd::Lanes> angle_arcsec) override {
        for (std::size_t lane = 0; lane < setups_.size(); ++lane) {
            effects::Interval at;
            for (std::size_t i = 0; i < angle_arcsec.size(); ++i) {
                at.start_s = intervals.start_s[i][lane];
                at.duration_s = intervals.duration_s[i][lane];
                for (const int end : {0, 1}) {
                    const double time_s = at.start_s + end * at.duration_s;
                    at.input_rate_deg_h[end] = input_rate_at_deg_h(scenario_, setups_[lane], time_s);
                    if (temperature_varies_) {
                        at.temperature_change_k[end] = scenario::temperature_change_k(scenario_.environment, time_s);
                    }
                }
                angle_arcsec[i][lane] += added_angle_arcsec_(at);
            }
        }
    }

   private:
    effects::AddedAngle added_angle_arcsec_;
    scenario::Scenario scenario_;
    std::vector<gyro::Setup> setups_;
    bool temperature_varies_;
};

}  // namespace

std::unique_ptr<effects::LaneRateProcess> added_angles(const effects::Effect& effect, const effects::Values& values,
                                                       const scenario::Scenario& scenario,
                                                       const std::vector<gyro::Setup>& setups) {
    return std::make_unique<AddedAngles>(effect, values, scenario, setups);
}

}  // namespace ringlock::ensemble
