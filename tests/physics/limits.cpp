// How far compensators are from the bound that the readout allows (docs/dev/compensation.md).
#include "tests/support/limits.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "engine/core/units.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/gyro/theory.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::test {
namespace limits_test {
namespace {

scenario::Scenario what_limits(const std::vector<std::string>& arms) {
    scenario::Scenario scenario =
        scenario::parse_file(std::filesystem::path(RINGLOCK_SOURCE_DIR) / "scenarios/what-limits.toml");
    scenario.arms = scenario::parse_arms(arms);
    return scenario;
}

/// What is asserted of a ratio: the upper end of its 95 % interval.
double shown(const char* what, const limits::Ratio& ratio) {
    std::printf("%s: %.4f (%.4f .. %.4f)\n", what, ratio.value, ratio.lo, ratio.hi);
    return ratio.hi;
}

double bound_deg_rt_h(const scenario::Scenario& scenario) {
    return limits::walk_deg_rt_h(scenario, limits::bounds(scenario).known_rad);
}

TEST(Limits, TheScenarioIsTheInstrumentAtItsDefaults) {
    const scenario::Scenario scenario = what_limits({limits::exact_arm});
    scenario::Readout defaults;
    defaults.model = scenario::ReadoutModel::instrument;
    EXPECT_EQ(scenario.readout, defaults);
    EXPECT_EQ(scenario.readout.adc_bits, 12);
    EXPECT_EQ(scenario.readout.detector_noise_relative, 0.005);
    EXPECT_EQ(scenario.readout.comparator_noise_relative, 0.005);
    EXPECT_EQ(scenario.readout.clock_hz, 100e6);
    EXPECT_EQ(scenario.effects.at("quantum_noise").at("deg_rt_h"), 0.0);
    EXPECT_EQ(scenario.ensemble.settle_s, 200.0);
    EXPECT_NEAR(limits::bounds(scenario).known_rad, 0.00167, 1e-5);
    EXPECT_NEAR(bound_deg_rt_h(scenario), 3.76e-6, 0.02e-6);
}

TEST(Limits, TheExactCompensatorIsWithinATenthOfTheBound) {
    scenario::Scenario scenario = what_limits({limits::exact_arm});
    scenario.ensemble.gyros = 32;
    scenario.ensemble.settle_s = 20.0;
    scenario.ensemble.duration_s = 600.0;
    const limits::Ratio ratio = limits::over(limits::walks(scenario).of(limits::exact_arm), bound_deg_rt_h(scenario));
    EXPECT_LE(shown("exact over bound", ratio), 1.1);
    // It reads the phase no better than the bound: no walk is below it but by chance.
    EXPECT_GE(ratio.hi, 1.0);
}

TEST(Limits, ACouplingPhaseThatIsNotToldLeavesARate) {
    scenario::Scenario scenario = what_limits({limits::exact_arm});
    scenario.ensemble.gyros = 32;
    scenario.ensemble.settle_s = 20.0;
    scenario.ensemble.duration_s = 300.0;
    const double phase_rad = 0.3;
    scenario.effects["detector_phase_offset"]["phase_rad"] = phase_rad;
    const limits::Walks walks = limits::walks(scenario);
    double mean = 0.0;
    double squares = 0.0;
    for (const double rate : walks.rate_error_deg_h[0]) {
        mean += rate / 32.0;
        squares += rate * rate;
    }
    const double standard_error = std::sqrt((squares / 32.0 - mean * mean) / 31.0);
    const gyro::Setup setup = ensemble::nominal_setup(scenario);
    const double kappa = gyro::turn_kick_rad(setup);
    const double expected = -0.5 * kappa * kappa * std::sin(phase_rad) * setup.scale_factor_arcsec / units::two_pi *
                            setup.dither_frequency_hz;
    std::printf("rate %.5f +- %.5f deg/h, expected %.5f\n", mean, standard_error, expected);
    // Three standard errors, and a kappa^2 of it for the next order.
    EXPECT_NEAR(mean, expected, 3.0 * standard_error + kappa * kappa * std::abs(expected));
    EXPECT_LT(standard_error, 0.02 * std::abs(expected));
}

TEST(LongAdaptiveLimit, TheAdaptiveCompensatorIsWithinATenthOfTheExactOne) {
    scenario::Scenario scenario = what_limits({limits::exact_arm});
    scenario.ensemble.gyros = 32;
    scenario.ensemble.duration_s = 1000.0;
    const limits::Walks exact = limits::walks(scenario);
    scenario.arms = scenario::parse_arms({limits::adaptive_arm});
    scenario.calibration.threshold_error_relative = 0.3;
    const limits::Walks adaptive = limits::walks(scenario);
    EXPECT_LE(shown("adaptive, told 30 % too much, over exact",
                    limits::over(adaptive.of(limits::adaptive_arm), exact.of(limits::exact_arm))),
              1.1);
}

/// At the full length of the scenario.
class LongLimits : public testing::Test {
   protected:
    static const limits::Walks& reference() {
        static const limits::Walks walks = limits::walks(what_limits({limits::exact_arm, limits::adaptive_arm}));
        return walks;
    }
    static double over_exact(const char* what, const limits::Walks& walks) {
        return shown(what, limits::over(walks.of(limits::adaptive_arm), reference().of(limits::exact_arm)));
    }
};

TEST_F(LongLimits, TheExactCompensatorIsWithinATenthOfTheBound) {
    const limits::Ratio ratio =
        limits::over(reference().of(limits::exact_arm), bound_deg_rt_h(what_limits({limits::exact_arm})));
    EXPECT_LE(shown("exact over bound", ratio), 1.1);
    EXPECT_GE(ratio.hi, 1.0);
}

TEST_F(LongLimits, TheAdaptiveCompensatorIsWithinATenthOfTheExactOne) {
    EXPECT_LE(over_exact("adaptive over exact", reference()), 1.1);
}

TEST_F(LongLimits, WhateverThresholdItIsTold) {
    for (const double error : {0.3, -0.3}) {
        scenario::Scenario scenario = what_limits({limits::adaptive_arm});
        scenario.calibration.threshold_error_relative = error;
        EXPECT_LE(over_exact("adaptive, told 30 % wrong, over exact", limits::walks(scenario)), 1.1) << error;
    }
}

TEST_F(LongLimits, WhileTheThresholdDriftsByATenthAnHour) {
    for (const double kelvin_per_h : {10.0, -10.0}) {
        scenario::Scenario scenario = what_limits({limits::adaptive_arm});
        scenario.environment.temperature_ramp_k_per_h = kelvin_per_h;
        scenario.effects["lockin_temperature"]["relative_per_k"] = 0.01;
        // Kicks, and the bound with them, go with the threshold: in the middle of the record it is the one without
        // drift.
        const double middle_h = (scenario.ensemble.settle_s + 0.5 * scenario.ensemble.duration_s) / 3600.0;
        scenario.gyro.lockin_threshold_deg_h /= 1.0 + 0.01 * kelvin_per_h * middle_h;
        EXPECT_LE(over_exact("adaptive under a drift over exact without", limits::walks(scenario)), 1.1)
            << kelvin_per_h;
    }
}

TEST_F(LongLimits, TheAdaptiveCompensatorStaysThereBeyondTheMemoryOfTheSize) {
    // Of averaging times up to an eighth of what it has learnt from: of the phase's wander a hundredth is left there.
    scenario::Scenario scenario = what_limits({limits::exact_arm, limits::adaptive_arm});
    scenario.ensemble.settle_s = 4000.0;
    scenario.ensemble.duration_s = 8000.0;
    const limits::Walks walks = limits::walks(scenario);
    for (std::size_t i = 0; i < walks.tau_s.size() && walks.tau_s[i] < 600.0; ++i) {
        if (walks.tau_s[i] < 0.9) continue;
        std::printf("%.1f s, ", walks.tau_s[i]);
        const auto over = limits::over(walks.squared_at[walks.index(limits::adaptive_arm)][i],
                                       walks.squared_at[walks.index(limits::exact_arm)][i]);
        EXPECT_LE(shown("adaptive over exact", over), 1.1) << walks.tau_s[i];
    }
}

}  // namespace
}  // namespace limits_test
}  // namespace ringlock::test
