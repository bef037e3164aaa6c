#pragma once
#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "engine/scenario/arm.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::test {

/// All arms that the readout of a scenario can serve, in their usual order: a latched one keeps no pulses.
inline std::vector<std::string> served_arms(const scenario::Scenario& s) {
    std::vector<std::string> names = scenario::arm_names();
    std::erase_if(names, [&](const std::string& name) {
        const scenario::Compensator compensator = scenario::parse_arm(name).compensator;
        return s.readout.model == scenario::ReadoutModel::latched &&
               (compensator == scenario::Compensator::extrapolated || compensator == scenario::Compensator::adaptive);
    });
    return names;
}

/// Small scenarios at random from a seed of their own, so that a failure comes back.
class RandomScenarios {
   public:
    explicit RandomScenarios(std::uint64_t seed) : engine_(seed) {}

    double uniform(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(engine_); }
    std::int64_t whole(std::int64_t lo, std::int64_t hi) {
        return std::uniform_int_distribution<std::int64_t>(lo, hi)(engine_);
    }
    bool coin() { return whole(0, 1) == 1; }

    /// Some of the arms that a scenario's readout can serve, in any order.
    std::vector<std::string> arms(const scenario::Scenario& s) {
        std::vector<std::string> names = served_arms(s);
        std::shuffle(names.begin(), names.end(), engine_);
        names.resize(static_cast<std::size_t>(whole(1, static_cast<std::int64_t>(names.size()))));
        return names;
    }

    /// A valid scenario of a device that differs from the paper's in everything.
    scenario::Scenario next() {
        for (;;) {
            scenario::Scenario s;
            s.gyro = {.scale_factor_arcsec = uniform(0.3, 1.5), .lockin_threshold_deg_h = uniform(50.0, 800.0)};
            s.dither = {.frequency_hz = uniform(100.0, 400.0), .peak_rate_deg_s = uniform(60.0, 200.0)};
            s.noise_injection.turn_phase_rms_rad = uniform(0.1, 4.0);
            s.readout.model = coin()   ? scenario::ReadoutModel::instrument
                              : coin() ? scenario::ReadoutModel::latched
                                       : scenario::ReadoutModel::ideal;
            s.readout.angle_output =
                coin() ? scenario::AngleOutput::interpolated : scenario::AngleOutput::quarter_fringe;
            s.readout.detector_noise_relative = uniform(0.0, 0.02);
            if (s.readout.model == scenario::ReadoutModel::instrument) {
                s.readout.phase_from = coin() ? scenario::PhaseFrom::detectors : s.readout.phase_from;
                s.readout.comparator_noise_relative = coin() ? uniform(0.0, 0.02) : 0.0;
                s.readout.comparator_hysteresis_relative = uniform(0.0, 0.1);
                s.readout.detector_bandwidth_hz = coin() ? uniform(2e6, 2e7) : 0.0;
                s.readout.adc_bits = coin() ? whole(6, 16) : 0;
            }
            s.input.rate_deg_h = uniform(-50.0, 50.0);
            s.effects["quantum_noise"]["deg_rt_h"] = coin() ? uniform(0.0, 0.01) : 0.0;
            s.effects["rate_random_walk"]["deg_h_rt_h"] = coin() ? uniform(0.0, 1.0) : 0.0;
            s.effects["detector_phase_offset"]["phase_rad"] = coin() ? uniform(-1.0, 1.0) : 0.0;
            s.ensemble.gyros = whole(2, 6);
            s.ensemble.duration_s = uniform(1.0, 2.0);
            s.ensemble.seed = static_cast<std::uint64_t>(whole(0, 1'000'000));
            s.ensemble.lockin_threshold_sd_relative = uniform(0.0, 0.1);
            s.output.sample_interval_s = uniform(0.05, 0.3);
            s.arms = scenario::parse_arms(arms(s));
            if (scenario::check(s).empty()) return s;
        }
    }

   private:
    std::mt19937_64 engine_;
};

}  // namespace ringlock::test
