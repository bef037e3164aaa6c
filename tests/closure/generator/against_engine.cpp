// Two simulators that share no code, on the same drive. The only test of this folder that knows the engine.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "engine/gyro/half_cycle.hpp"
#include "tests/closure/generator/generator.hpp"
#include "tests/support/direct.hpp"

namespace generator_against_engine_test {
namespace {

using namespace ringlock;
using namespace ringlock::test::closure;

/// Lets the engine go from turn to turn by itself, along the drive that the generator made, and compares phases.
void expect_same_path(const Truth& truth, const Trajectory& path, const char* what) {
    const double first = path.turn_phase_rad.front();
    double lockin = 0.0;
    double worst_half = 0.0;
    double worst = 0.0;
    for (std::size_t row = 1; row < path.turn_phase_rad.size(); ++row) {
        // Row 0 is a minimum.
        const gyro::HalfCycle half{row % 2 == 1 ? 1.0 : -1.0,
                                   path.amplitude_rad[row],
                                   path.dither_turn_s[row] - path.dither_turn_s[row - 1],
                                   path.rate_rad_s[row],
                                   truth.dither_second_harmonic.ratio,
                                   truth.dither_second_harmonic.phase_rad};
        const gyro::Coupling coupling{path.b_rad_s[row], truth.detector_phase_offset_rad, truth.lockin_turn_asymmetry,
                                      truth.lockin_second_harmonic.ratio, truth.lockin_second_harmonic.phase_rad};
        ringlock::test::DirectIntegrator engine(coupling, 1e-11);
        const double phase = first + path.plain_rad[row - 1] - path.plain_rad[0] + lockin;
        lockin += engine.lockin_gain_rad(std::remainder(phase, 2.0 * std::numbers::pi), half);
        worst = std::max(worst, std::abs(lockin - (path.lockin_rad[row] - path.lockin_rad[0])));
        // And over the half cycle alone, from the generator's own phase
        const double alone =
            engine.lockin_gain_rad(std::remainder(path.turn_phase_rad[row - 1], 2.0 * std::numbers::pi), half);
        worst_half = std::max(worst_half, std::abs(alone - (path.lockin_rad[row] - path.lockin_rad[row - 1])));
    }
    // A half cycle: the generator's steps leave 1e-8 rad at most, the phases of these sums 1e-11. What single half
    // cycles leave adds up over the record.
    EXPECT_LT(worst_half, 1e-8) << what;
    EXPECT_LT(worst, 1e-6) << what;
}

TEST(ClosureAgainstEngine, TurnPhasesAgree) {
    std::vector<Truth> truths;
    std::vector<const char*> names;
    const auto add = [&](const char* name, auto change) {
        Truth truth;
        truth.turns = 30;
        truth.initial_phase_rad = 1.3;
        truth.input_rate_deg_h = 15.0;
        truth.seed = truths.size();
        change(truth);
        truths.push_back(truth);
        names.push_back(name);
    };
    add("the paper's device", [](Truth&) {});
    add("injected noise, white rates", [](Truth& t) {
        t.injected_noise_rad = 3.0;
        t.rates.quantum_noise_deg_rt_h = 1e-3;
    });
    add("amplitude wander and high rate", [](Truth& t) {
        t.wander.walk_per_turn = 1e-4;
        t.input_rate_deg_h = 20000.0;
    });
    add("asymmetry, coupling phase", [](Truth& t) {
        t.dither_asymmetry = 0.02;
        t.detector_phase_offset_rad = 0.8;
    });
    add("threshold and temperature", [](Truth& t) {
        t.lockin_threshold_deg_h = 1200.0;
        t.lockin_temperature_per_k = 0.1;
        t.temperature.ramp_k_per_h = 3600.0;
    });
    add("coarse fringes", [](Truth& t) {
        t.scale_factor_arcsec = 2.6;
        t.dither_frequency_hz = 400.0;
        t.dither_peak_rate_deg_s = 60.0;
    });
    add("second harmonic of the coupling", [](Truth& t) { t.lockin_second_harmonic = {0.05, 0.4}; });
    add("turn asymmetry and second harmonic of the dither", [](Truth& t) {
        t.lockin_turn_asymmetry = 0.2;
        t.dither_second_harmonic = {0.02, -0.9};
        t.injected_noise_rad = 2.0;
    });
    add("everything", [](Truth& t) {
        t.lockin_second_harmonic = {0.05, 2.4};
        t.detector_phase_offset_rad = -0.5;
        t.lockin_turn_asymmetry = -0.1;
        t.dither_second_harmonic = {0.01, 0.3};
        t.dither_asymmetry = -0.03;
        t.injected_noise_rad = 5.0;
    });
    const std::vector<Generated> records = generate_with_trajectory(truths);
    for (std::size_t i = 0; i < truths.size(); ++i) expect_same_path(truths[i], records[i].trajectory, names[i]);
}

}  // namespace
}  // namespace generator_against_engine_test
