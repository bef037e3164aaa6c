#include "tests/support/limits.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <stdexcept>

#include "engine/core/units.hpp"
#include "engine/ensemble/calibration.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/gyro/device.hpp"
#include "engine/scenario/arm.hpp"

namespace ringlock::test::limits {

Bounds bounds(const scenario::Scenario& scenario) {
    const gyro::Device device(ensemble::nominal_setup(scenario));
    const readout::Electronics of = ensemble::electronics_of(scenario);
    const double a = device.half_cycle(1.0, device.dither_amplitude_rad).end_acceleration_rad_s2();
    // Half cycles have (n_{k+1} - n_k)/2 of the turns' noise: 1/2 of its variance, of which the one before tells a
    // quarter.
    const double after = scenario.noise_injection.turn_phase_rms_rad * std::sqrt(0.5 * 0.75);
    return {readout::phase_bound_rad(of, {a}), readout::phase_bound_rad(of, {a, after / device.dither_amplitude_rad}),
            readout::phase_bound_rad(of, {a, 0.0, false})};
}

double walk_deg_rt_h(const scenario::Scenario& scenario, double phase_rad) {
    return readout::walk_left_deg_rt_h(ensemble::nominal_setup(scenario), phase_rad);
}

std::vector<std::string> compensated_arms() {
    std::vector<std::string> arms;
    for (const std::string& name : scenario::arm_names()) {
        const scenario::Arm arm = scenario::parse_arm(name);
        if (!arm.noise_injected || arm.compensator == scenario::Compensator::none) continue;
        if (arm.compensator == scenario::Compensator::published) continue;
        arms.push_back(name);
    }
    return arms;
}

std::size_t Walks::index(const std::string& arm) const {
    const auto found = std::find(arms.begin(), arms.end(), arm);
    if (found == arms.end()) throw std::out_of_range("no arm " + arm);
    return static_cast<std::size_t>(found - arms.begin());
}

Walks walks(const scenario::Scenario& scenario) {
    const study::Study study = study::run(study::Study(scenario), 2);
    Walks walks;
    for (const study::ArmStatistics& arm : study.arms) {
        walks.arms.push_back(arm.arm.name);
        std::vector<double>& squared = walks.squared.emplace_back();
        std::vector<double>& rates = walks.rate_error_deg_h.emplace_back();
        std::vector<std::vector<double>>& at = walks.squared_at.emplace_back();
        walks.tau_s.clear();
        for (const allan::Point& point : arm.gyros.front().allan) walks.tau_s.push_back(point.tau_s);
        at.resize(walks.tau_s.size());
        for (const study::GyroStatistics& gyro : arm.gyros) {
            // Errors of single readings are angle noise, whatever becomes of their sum.
            squared.push_back(std::pow(gyro.noise.pooling.arw_beside_angle_noise_deg_rt_h, 2));
            rates.push_back(gyro.rate_error_deg_h);
            for (std::size_t i = 0; i < at.size(); ++i) {
                const double walk =
                    gyro.allan[i].dev * std::sqrt(gyro.allan[i].tau_s) * units::deg_rt_h_per_arcsec_rt_s;
                at[i].push_back(walk * walk);
            }
        }
    }
    return walks;
}

namespace {

double mean(const std::vector<double>& values, const std::vector<std::size_t>& drawn) {
    double sum = 0.0;
    for (const std::size_t i : drawn) sum += values[i];
    return sum / static_cast<double>(drawn.size());
}

Ratio bootstrap(std::size_t gyros, const std::function<double(const std::vector<std::size_t>&)>& ratio) {
    constexpr int rounds = 2000;
    std::vector<std::size_t> drawn(gyros);
    for (std::size_t i = 0; i < gyros; ++i) drawn[i] = i;
    Ratio result{ratio(drawn)};
    std::mt19937_64 engine(2007);
    std::vector<double> values;
    for (int round = 0; round < rounds; ++round) {
        for (std::size_t& i : drawn) i = (engine() >> 32) * gyros >> 32;
        values.push_back(ratio(drawn));
    }
    std::sort(values.begin(), values.end());
    result.lo = values[static_cast<std::size_t>(0.025 * rounds)];
    result.hi = values[static_cast<std::size_t>(0.975 * rounds) - 1];
    return result;
}

}  // namespace

Ratio over(const std::vector<double>& squared, double walk_deg_rt_h) {
    return bootstrap(squared.size(), [&](const std::vector<std::size_t>& drawn) {
        return std::sqrt(mean(squared, drawn)) / walk_deg_rt_h;
    });
}

Ratio over(const std::vector<double>& squared, const std::vector<double>& other) {
    return bootstrap(squared.size(), [&](const std::vector<std::size_t>& drawn) {
        return std::sqrt(mean(squared, drawn) / mean(other, drawn));
    });
}

}  // namespace ringlock::test::limits
