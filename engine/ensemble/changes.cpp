#include "engine/ensemble/changes.hpp"

#include <algorithm>
#include <utility>

#include "engine/ensemble/draw.hpp"
#include "engine/gyro/device.hpp"

namespace ringlock::ensemble {

namespace {

class AddedAngles final : public effects::LaneRateProcess {
   public:
    AddedAngles(AngleOver added, std::size_t lanes) : added_(std::move(added)), lanes_(lanes) {}

    void add_angles(const effects::LaneIntervals& intervals, std::span<simd::Lanes> angle_arcsec) override {
        for (std::size_t lane = 0; lane < lanes_; ++lane) {
            for (std::size_t i = 0; i < angle_arcsec.size(); ++i) {
                angle_arcsec[i][lane] += added_(lane, intervals.start_s[i][lane], intervals.duration_s[i][lane]);
            }
        }
    }

   private:
    AngleOver added_;
    std::size_t lanes_;
};

}  // namespace

AngleOver angle_of(const scenario::ActiveEffect& active, const scenario::Scenario& scenario,
                   const std::vector<gyro::Setup>& setups) {
    return [change = active.effect->change(*active.values), scenario, setups,
            temperature_varies = scenario::temperature_varies(scenario.environment)](std::size_t lane, double start_s,
                                                                                     double duration_s) {
        effects::Interval at;
        at.start_s = start_s;
        at.duration_s = duration_s;
        for (const int end : {0, 1}) {
            const double time_s = start_s + end * duration_s;
            at.input_rate_deg_h[end] = input_rate_at_deg_h(scenario, setups[lane], time_s);
            if (temperature_varies) {
                at.temperature_change_k[end] = scenario::temperature_change_k(scenario.environment, time_s);
            }
        }
        return change(at).angle_arcsec;
    };
}

AngleOver angle_of_profile(const scenario::InputRate& input, const std::vector<gyro::Setup>& setups) {
    std::vector<double> mean_deg_h;
    for (const gyro::Setup& setup : setups) mean_deg_h.push_back(setup.input_rate_deg_h);
    return [input, mean_deg_h](std::size_t lane, double start_s, double duration_s) {
        return scenario::profile_angle_arcsec(input, start_s, duration_s) - mean_deg_h[lane] * duration_s;
    };
}

std::unique_ptr<effects::LaneRateProcess> angles_of(AngleOver added, std::size_t lanes) {
    return std::make_unique<AddedAngles>(std::move(added), lanes);
}

CouplingChanges::CouplingChanges(const scenario::Scenario& scenario, const std::vector<gyro::Setup>& setups)
    : scenario_(scenario) {
    for (const auto& [effect, values] : scenario::active_effects(scenario)) {
        const effects::Bounds bounds = effect->bounds(*values, scenario::exposure(scenario));
        if (bounds.threshold_relative == 0.0 && bounds.coupling_phase_rad == 0.0) continue;
        thresholds_vary_ = thresholds_vary_ || bounds.threshold_relative != 0.0;
        phases_vary_ = phases_vary_ || bounds.coupling_phase_rad != 0.0;
        changes_.push_back(effect->change(*values));
    }
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        setups_.push_back(setups[std::min(lane, setups.size() - 1)]);
        period_s_.push_back(gyro::Device(setups_.back()).period_s());
    }
}

void CouplingChanges::evaluate(std::int64_t first_turn, std::size_t turns) {
    if (changes_.empty()) return;
    if (thresholds_vary_) factors_.resize(turns);
    if (phases_vary_) phases_rad_.resize(turns);
    for (std::size_t i = 0; i < turns; ++i) {
        const std::int64_t number = first_turn + static_cast<std::int64_t>(i);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            effects::Interval middle;
            middle.start_s = (0.5 * static_cast<double>(number) + 0.25) * period_s_[lane];
            const double change_k = scenario::temperature_change_k(scenario_.environment, middle.start_s);
            const double rate_deg_h = input_rate_at_deg_h(scenario_, setups_[lane], middle.start_s);
            for (const int end : {0, 1}) {
                middle.temperature_change_k[end] = change_k;
                middle.input_rate_deg_h[end] = rate_deg_h;
            }
            double factor = 1.0;
            double phase_rad = 0.0;
            for (const effects::ChangeOver& change : changes_) {
                const effects::Change changed = change(middle);
                factor *= changed.threshold_factor;
                phase_rad += changed.coupling_phase_rad;
            }
            if (thresholds_vary_) factors_[i][lane] = factor;
            if (phases_vary_) phases_rad_[i][lane] = phase_rad;
        }
    }
}

}  // namespace ringlock::ensemble
