#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/dither/lane_dither.hpp"
#include "engine/ensemble/changes.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/propagate/lane_propagator.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/gyro_records.hpp"
#include "tests/support/odeint.hpp"

// A mode hop in the middle of a run: bias, threshold and phase of the coupling step at one time.
namespace ringlock::test {
namespace mode_hop_test {
namespace {

constexpr std::size_t half_cycles = 20;
constexpr double hop_s = 0.04323;  // inside half cycle 10
constexpr double step_deg_h = 500.0;
constexpr double threshold_ratio = 0.3;
constexpr double phase_rad = 1.2;

scenario::Scenario hopping() {
    scenario::Scenario s;
    s.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    s.effects["detector_phase_offset"]["phase_rad"] = 0.4;
    s.effects["mode_hop"] = {
        {"step_deg_h", step_deg_h}, {"threshold_ratio", threshold_ratio}, {"phase_rad", phase_rad}, {"time_s", hop_s}};
    s.readout.model = scenario::ReadoutModel::ideal;
    return s;
}

/// Lock-in of each turn [rad] of gyro 0 by odeint, the hop taken from the numbers above alone.
std::vector<double> by_odeint(const gyro::Setup& setup) {
    const gyro::Device device(setup);
    std::vector<double> lockin_rad;
    double lockin = 0.0;
    double psi = device.initial_phase_rad;
    double time_s = 0.0;
    for (std::size_t i = 0; i < half_cycles; ++i) {
        lockin_rad.push_back(lockin);
        const double sign = i % 2 == 0 ? 1.0 : -1.0;
        gyro::HalfCycle half = device.half_cycle(sign, device.dither_amplitude_rad);
        gyro::Coupling coupling = device.coupling;
        const double after_s = std::clamp(time_s + half.duration_s - hop_s, 0.0, half.duration_s);
        half.rate_rad_s += device.phase_per_arcsec * step_deg_h * after_s / half.duration_s;
        if (time_s + 0.5 * half.duration_s > hop_s) {
            coupling.b_rad_s *= 1.0 + threshold_ratio;
            coupling.phase_rad += phase_rad;
        }
        Odeint odeint(coupling, 1e-13);
        const double gain = odeint.lockin_gain_rad(std::remainder(psi, units::two_pi), half);
        psi += half.plain_phase_total_rad() + gain;
        lockin += gain;
        time_s += half.duration_s;
    }
    return lockin_rad;
}

TEST(ModeHop, IsFollowedByBothPropagators) {
    const scenario::Scenario s = hopping();
    const gyro::Setup setup = ensemble::draw_setup(s, 0);
    const std::vector<gyro::Setup> setups{setup};
    const std::vector<gyro::Device> devices{gyro::Device(setup)};
    const std::vector<double> expected = by_odeint(setup);

    ensemble::CouplingChanges coupling(s, setups);
    coupling.evaluate(0, half_cycles);
    std::vector<simd::Lanes> start_s(half_cycles), duration_s(half_cycles), angle_arcsec(half_cycles);
    double time_s = 0.0;
    for (std::size_t i = 0; i < half_cycles; ++i) {
        start_s[i][0] = time_s;
        duration_s[i][0] = i % 2 == 0 ? devices[0].positive_duration_s : devices[0].negative_duration_s;
        time_s += duration_s[i][0];
    }
    ASSERT_GT(time_s, 1.5 * hop_s);
    for (const scenario::ActiveEffect& active : scenario::active_effects(s)) {
        const auto angles = ensemble::angles_of(ensemble::angle_of(active, s, setups), setups.size());
        angles->add_angles({1, 0, start_s, duration_s}, angle_arcsec);
    }
    propagate::DirectPropagator direct(devices, 1e-12);
    const auto map = propagate::make_turn_map(devices, {}, 1e-10);
    for (propagate::LanePropagator* propagator : {static_cast<propagate::LanePropagator*>(&direct), map.get()}) {
        dither::LaneDither dither(devices, 0.0, {});
        gyro::LaneDrive drive;
        gyro::LaneTurns turns;
        dither.next(half_cycles, angle_arcsec, coupling.threshold_factors(), drive, coupling.phases_rad());
        propagator->step(drive, turns);
        for (std::size_t i = 0; i < half_cycles; ++i) {
            const double lockin = units::two_pi * (turns.lockin_whole[0] + turns.lockin_fringes[i][0]);
            // Twenty half cycles, each right to 1e-10 rad at most; kicks of 0.2 rad make no error much larger.
            EXPECT_NEAR(lockin, expected[i], 6e-9) << "turn " << i;
        }
    }
}

TEST(ModeHop, LeavesTheSameOutputByBothPropagators) {
    scenario::Scenario s = hopping();
    s.arms = scenario::parse_arms({"uncompensated", "noise_injected"});
    s.ensemble.gyros = 1;
    s.ensemble.duration_s = 1.5;
    s.output.sample_interval_s = 0.5;
    s.effects["mode_hop"]["time_s"] = 0.75;
    GyroRecords map(s, 1);
    map.run(0, 1, 1);
    s.propagation.method = scenario::PropagationMethod::direct;
    GyroRecords direct(s, 1);
    direct.run(0, 1, 1);
    for (std::size_t a = 0; a < s.arms.size(); ++a) {
        ASSERT_EQ(map[0].counts[a].size(), direct[0].counts[a].size());
        for (std::size_t i = 0; i < map[0].counts[a].size(); ++i) {
            // 375 half cycles of 1e-10 rad each, and what a count of the output is rounded by, in arcsec.
            ASSERT_NEAR(map[0].angle_arcsec(a, i), direct[0].angle_arcsec(a, i), 5e-9) << a << " cycle " << i;
        }
    }
}

}  // namespace
}  // namespace mode_hop_test
}  // namespace ringlock::test
