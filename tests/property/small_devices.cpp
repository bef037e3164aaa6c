// Devices at the edge of what the turn map can do: each scenario that the rules let pass must run.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/scenario/text/render.hpp"
#include "tests/property/random_scenario.hpp"
#include "tests/support/gyro_records.hpp"

namespace ringlock::test {
namespace small_devices_test {
namespace {

using scenario::Scenario;

/// A device of `fringes` in a half cycle and kicks of `kick_rad`, both of the nominal dither.
Scenario small_device(RandomScenarios& random, double fringes, double kick_rad) {
    Scenario s;
    s.gyro.scale_factor_arcsec = random.uniform(0.3, 3.0);
    s.dither.frequency_hz = random.uniform(50.0, 500.0);
    // Fringes are 2 Omega_D/(K w), kappa is 2 pi Omega_L/sqrt(K Omega_D w).
    const double w = units::two_pi * s.dither.frequency_hz;
    const double peak_deg_h = 0.5 * fringes * s.gyro.scale_factor_arcsec * w;
    s.dither.peak_rate_deg_s = peak_deg_h / units::deg_h_per_deg_s;
    s.gyro.lockin_threshold_deg_h = kick_rad * std::sqrt(s.gyro.scale_factor_arcsec * peak_deg_h * w) / units::two_pi;
    s.input.rate_deg_h = random.coin() ? random.uniform(-0.5, 0.5) * peak_deg_h : 0.0;
    s.ensemble.gyros = 1;
    s.ensemble.duration_s = 31.0 / s.dither.frequency_hz;
    s.output.sample_interval_s = 10.0 / s.dither.frequency_hz;
    s.ensemble.seed = static_cast<std::uint64_t>(random.whole(0, 1'000'000));
    s.ensemble.lockin_threshold_sd_relative = 0.0;
    const double amplitude_rad = units::pi * fringes;
    s.noise_injection.turn_phase_rms_rad = random.coin()
                                               ? random.uniform(0.0, 1.1) * amplitude_rad * std::numbers::sqrt2 / 16.0
                                               : random.uniform(0.0, 3.0);
    if (random.coin()) s.effects["dither_asymmetry"]["ratio"] = random.uniform(-0.2, 0.2);
    if (random.coin()) s.effects["lockin_turn_asymmetry"]["ratio"] = random.uniform(-0.5, 0.5);
    if (random.coin()) {
        s.effects["dither_second_harmonic"] = {{"ratio", random.uniform(-0.1, 0.1)},
                                               {"phase_rad", random.uniform(-3.0, 3.0)}};
    }
    if (random.coin()) s.effects["base_vibration"]["rate_deg_h"] = random.uniform(0.0, 1e4);
    if (random.coin()) s.effects["quantum_noise"]["deg_rt_h"] = random.uniform(0.0, 0.1);
    s.arms = scenario::parse_arms({"uncompensated", "noise_injected+compensated_exact"});
    // Wide tables need many nodes to a fine tolerance, and are refused for that; here it is the map that is asked
    // after.
    s.propagation.turn_map_tolerance_rad = 1e-4;
    return s;
}

/// What the first gyro's run fails with; nothing where it does not.
std::string failure(const Scenario& s) {
    GyroRecords records(s, 1);
    try {
        records.run(0, 1, 1);
    } catch (const RunError& error) {
        return error.what();
    }
    return "";
}

TEST(SmallDevices, RunWhereNoRuleIsBroken) {
    RandomScenarios random(31);
    int run = 0;
    int refused = 0;
    while (run < 40) {
        const Scenario s = small_device(random, random.uniform(10.0, 60.0), random.uniform(0.0, 1.0));
        if (!scenario::check(s).empty()) {
            ++refused;
            continue;
        }
        ++run;
        EXPECT_EQ(failure(s), "") << to_toml(s);
    }
    std::printf("%d run, %d refused\n", run, refused);
    EXPECT_GT(refused, 10);
}

TEST(SmallDevices, AreRefusedJustWhereTheTurnMapEnds) {
    // Nothing varies here, so that the corner that the rule asks for is the gyro that is run.
    RandomScenarios random(32);
    for (int i = 0; i < 6; ++i) {
        Scenario s = small_device(random, random.uniform(10.0, 10.3), random.uniform(0.0, 1.0));
        s.ensemble.dither_amplitude_sd_relative = 0.0;
        s.ensemble.dither_asymmetry_sd_ratio = 0.0;
        s.effects = scenario::default_effect_settings();
        s.effects["quantum_noise"]["deg_rt_h"] = 0.0;
        // Up to half of the peak rate a sinusoid of 10 fringes leaves 10 rad, one with such a harmonic does not.
        s.effects["dither_second_harmonic"] = {{"ratio", (random.coin() ? 1.0 : -1.0) * random.uniform(0.08, 0.1)},
                                               {"phase_rad", 0.4}};
        s.arms = scenario::parse_arms({"uncompensated"});
        double runs = 0.0;
        double fails = 0.499 * s.dither.peak_rate_deg_s * units::deg_h_per_deg_s;
        const auto refused = [&](double rate) {
            s.input.rate_deg_h = rate;
            return !scenario::check(s).empty();
        };
        ASSERT_FALSE(refused(runs)) << to_toml(s);
        ASSERT_TRUE(refused(fails)) << to_toml(s);
        while (fails - runs > 1e-6 * fails) {
            const double middle = 0.5 * (runs + fails);
            (refused(middle) ? fails : runs) = middle;
        }
        s.input.rate_deg_h = runs;
        EXPECT_EQ(failure(s), "") << to_toml(s);
        s.input.rate_deg_h = fails;
        EXPECT_NE(failure(s).find("no fast middle"), std::string::npos) << to_toml(s);
    }
}

}  // namespace
}  // namespace small_devices_test
}  // namespace ringlock::test
