// The prediction of what injected noise does, against the simulation of the exact turn map and against what is known.
#include "engine/dither/noise_effectiveness.hpp"

#include <algorithm>
#include <cstdio>

#include "analysis/study/study.hpp"
#include "analysis/study/summary.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace noise_effectiveness_test {
namespace {

scenario::Scenario noisy(const std::string& device, double rate_deg_h, const std::string& noise) {
    return scenario::parse_string(
        "device = \"" + device + "\"\n[input]\nrate_deg_h = " + std::to_string(rate_deg_h) +
            "\n[readout]\nmodel = \"ideal\"\n[ensemble]\ngyros = 96\nduration_s = 160.0\n"
            "dither_amplitude_sd_relative = 0.0\ndither_asymmetry_sd_ratio = 0.0\n"
            "[effects.quantum_noise]\ndeg_rt_h = 0.0\n[arms]\nnames = [\"noise_injected\"]\n[noise_injection]\n" +
            noise,
        "case");
}

/// Random walk of the ensemble's Allan deviation at about 10 s over that of randomised turns.
double measured_arw(const study::Study& study, const study::Summary& summary) {
    const auto& points = summary.arms.front().allan;
    const auto point = std::find_if(points.begin(), points.end(), [](const auto& p) { return p.tau_s > 8.0; });
    const double arw = point->dev_deg_h * std::sqrt(point->tau_s) * units::deg_rt_h_per_arcsec_rt_s;
    return arw / gyro::randomised_arw_deg_rt_h(ensemble::nominal_setup(study.scenario));
}

/// Random walk within 6 %, four standard errors of the simulation; bias within four of its own.
void expect_prediction_holds(const scenario::Scenario& scenario) {
    const study::Study study = study::run(study::Study(scenario), 2);
    const study::Summary summary = study::summarise(study);
    const study::NoiseFigures& figures = *summary.arms.front().noise_effectiveness;
    const double arw = measured_arw(study, summary);
    ASSERT_TRUE(figures.predicted.arw_over_theory) << figures.predicted.reason;
    std::printf("change %.3f rad a cycle; ARW over theory %.3f predicted, %.3f seen; bias %.4f, %.4f +- %.4f deg/h\n",
                figures.predicted.change_per_cycle_rad, *figures.predicted.arw_over_theory, arw,
                *figures.predicted.bias_deg_h, *figures.measured.bias_deg_h, figures.measured.bias_error_deg_h);
    EXPECT_NEAR(*figures.predicted.arw_over_theory, arw, 0.06 * arw);
    EXPECT_NEAR(*figures.predicted.bias_deg_h, *figures.measured.bias_deg_h, 4.0 * figures.measured.bias_error_deg_h);
    EXPECT_NEAR(figures.predicted.change_per_cycle_rad, figures.measured.change_per_cycle_rad,
                0.01 * figures.measured.change_per_cycle_rad);
}

TEST(NoiseEffectiveness, IndependentTurnsOfEnoughNoiseAreRandomised) {
    const scenario::Scenario scenario = noisy("gao-deng-2007", 1.0, "");
    const auto found = dither::predict_noise_effectiveness(ensemble::nominal_setup(scenario), {std::nullopt, 3.0});
    EXPECT_NEAR(found.change_per_cycle_rad, 3.0 * std::sqrt(2.0), 1e-12);
    EXPECT_NEAR(found.arw_over_theory.value(), 1.0, 2e-3);
    EXPECT_NEAR(found.bias_deg_h.value(), 0.0, 2e-3);
}

TEST(NoiseEffectiveness, WhatIndependentTurnsLeaveIsPredicted) {
    expect_prediction_holds(noisy("gao-deng-2007", 1.0, "turn_phase_rms_rad = 1.5\n"));
}

TEST(LongNoiseEffectiveness, HeldNoiseOfEveryDistributionIsPredicted) {
    const std::string drive = "model = \"drive\"\nturn_phase_rms_rad = 3.0\n";
    expect_prediction_holds(noisy("gao-deng-2007", 1.0, drive + "resonator_q = 100.0\n"));
    expect_prediction_holds(
        noisy("gao-deng-2007", 2.0, drive + "resonator_q = 50.0\nhold_half_cycles = 3\ndistribution = \"uniform\"\n"));
    expect_prediction_holds(
        noisy("gao-deng-2007", 0.5, drive + "resonator_q = 50.0\nhold_half_cycles = 4\ndistribution = \"binary\"\n"));
}

TEST(LongNoiseEffectiveness, WhiteNoiseIsPredicted) {
    expect_prediction_holds(noisy("triangle-51mm", 1.0,
                                  "model = \"drive\"\nform = \"white\"\nturn_phase_rms_rad = 10.0\n"
                                  "resonator_q = 200.0\n"));
}

TEST(NoiseEffectiveness, AnAmplitudeLoopIsPredicted) {
    expect_prediction_holds(noisy("gao-deng-2007", 1.0,
                                  "model = \"drive\"\nturn_phase_rms_rad = 3.0\nresonator_q = 200.0\n"
                                  "amplitude_loop_hz = 1.0\n"));
}

TEST(NoiseEffectiveness, ASinusoidIsDeterministic) {
    const scenario::Scenario scenario =
        noisy("gao-deng-2007", 1.0,
              "model = \"drive\"\nform = \"sinusoidal\"\nmodulation_hz = 3.0\nturn_phase_rms_rad = 3.0\n"
              "resonator_q = 100.0\n");
    const study::Study study = study::run(study::Study(scenario), 2);
    const study::NoiseFigures figures = *study::summarise(study).arms.front().noise_effectiveness;
    EXPECT_FALSE(figures.predicted.arw_over_theory);
    EXPECT_FALSE(figures.measured.arw_over_theory);
    EXPECT_NE(figures.predicted.reason, "");
    ASSERT_EQ(figures.predicted.angle_spread.size(), 3U);
    ASSERT_EQ(figures.measured.angle_spread.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
        // 96 gyros of random phases and 256 of other ones.
        EXPECT_NEAR(figures.predicted.angle_spread[i].arcsec, figures.measured.angle_spread[i].arcsec,
                    0.25 * figures.measured.angle_spread[i].arcsec);
    }
    // Over 100 and 160 s: what is left of the beginning is the spread over the time.
    const double left_deg_h = figures.predicted.angle_spread[2].arcsec / 100.0;
    EXPECT_NEAR(*figures.predicted.bias_deg_h, *figures.measured.bias_deg_h, 3.0 * left_deg_h);
}

TEST(NoiseEffectiveness, LongHoldsOfStrongNoiseAreFollowed) {
    expect_prediction_holds(noisy("gao-deng-2007", 1.0,
                                  "model = \"drive\"\nturn_phase_rms_rad = 60.0\nresonator_q = 100.0\n"
                                  "hold_half_cycles = 20\n"));
}

TEST(NoiseEffectiveness, SaysWhyItDoesNotPredict) {
    scenario::Scenario scenario = noisy("gao-deng-2007", 1.0, "");
    EXPECT_NE(dither::predict_noise_effectiveness(ensemble::nominal_setup(scenario), {std::nullopt, 0.0}).reason, "");
    scenario.input.sweep_stop_deg_h = 5.0;
    scenario.input.sweep_points = 3;
    study::Study study(scenario);
    study::predict_noise(study);
    EXPECT_FALSE(study.predicted_noise->arw_over_theory);
    EXPECT_FALSE(study.predicted_noise->bias_deg_h);
    EXPECT_NE(study.predicted_noise->reason, "");
    EXPECT_GT(study.predicted_noise->change_per_cycle_rad, 0.0);
}

TEST(NoiseEffectiveness, WhatWouldTakeMinutesIsNotPredicted) {
    gyro::Setup setup = ensemble::nominal_setup(noisy("gao-deng-2007", 1.0, ""));
    gyro::DriveNoise noise{.frequency_hz = setup.dither_frequency_hz, .resonator_q = 1e5};
    const auto slow = dither::predict_noise_effectiveness(setup, {noise, 3.0});
    EXPECT_FALSE(slow.arw_over_theory);
    EXPECT_FALSE(slow.bias_deg_h);
    EXPECT_NE(slow.reason, "");
    EXPECT_GT(slow.change_per_cycle_rad, 0.0);

    // A sinusoid on a dither of 100 kHz is followed for 1 s only.
    setup.dither_frequency_hz = 1e5;
    setup.dither_peak_rate_deg_s = 3e4;
    noise = {.frequency_hz = 1e5, .resonator_q = 100.0, .form = gyro::NoiseForm::sinusoidal, .modulation_hz = 3.0};
    const auto fast = dither::predict_noise_effectiveness(setup, {noise, 3.0});
    ASSERT_EQ(fast.angle_spread.size(), 1U);
    EXPECT_EQ(fast.angle_spread[0].after_s, 1.0);
    EXPECT_TRUE(fast.bias_deg_h);
}

TEST(NoiseEffectiveness, FastChangesOfAnySizeAreAskedForAtOnce) {
    const gyro::Setup setup = ensemble::nominal_setup(noisy("gao-deng-2007", 1.0, ""));
    const gyro::DriveNoise noise{.frequency_hz = setup.dither_frequency_hz, .resonator_q = 100.0};
    const auto found = dither::predict_noise_effectiveness(setup, {noise, 200.0});
    EXPECT_EQ(found.arw_over_theory.value(), 1.0);
    EXPECT_EQ(found.bias_deg_h.value(), 0.0);
}

TEST(NoiseEffectiveness, TheExactVarianceOfAKickIsTheMeanSquareOverAllPhases) {
    gyro::Setup setup = paper_device();
    for (const double threshold_deg_h : {30.0, 300.0, 1000.0, 2000.0, 6000.0}) {
        setup.lockin_threshold_deg_h = threshold_deg_h;
        const double kick = gyro::turn_kick_rad(setup);
        const double r = std::sqrt(-std::expm1(-0.25 * kick * kick));
        constexpr int phases = 20000;
        double sum = 0.0;
        for (int i = 0; i < phases; ++i) {
            const double phase = units::two_pi * i / phases;
            sum += std::pow(2.0 * std::atan2(r * std::sin(phase), 1.0 + r * std::cos(phase)), 2) / phases;
        }
        EXPECT_NEAR(gyro::randomised_kick_variance_rad2(setup), sum, 1e-7 * sum) << kick;
        const double ratio = gyro::randomised_arw_deg_rt_h(setup) / gyro::angle_random_walk_deg_rt_h(setup);
        EXPECT_NEAR(ratio, 1.0 - kick * kick / 32.0, 2e-3 * std::pow(kick, 4)) << kick;
    }
}

TEST(NoiseEffectiveness, TheExactRandomWalkIsThatOfTheTurnMapAtAKickOfOneRadian) {
    scenario::Scenario scenario = noisy("gao-deng-2007", 1.0, "turn_phase_rms_rad = 4.0\n");
    scenario.gyro.lockin_threshold_deg_h = 1974.0;
    const gyro::Setup setup = ensemble::nominal_setup(scenario);
    EXPECT_NEAR(gyro::turn_kick_rad(setup), 1.0, 2e-3);
    const study::Study study = study::run(study::Study(scenario), 2);
    const study::Summary summary = study::summarise(study);
    // At 1 s: 96 x 160 s, an error of 0.7 %.
    const auto& points = summary.arms.front().allan;
    const auto point = std::find_if(points.begin(), points.end(), [](const auto& p) { return p.tau_s > 0.9; });
    const double arw = point->dev_deg_h * std::sqrt(point->tau_s) * units::deg_rt_h_per_arcsec_rt_s;
    EXPECT_NEAR(arw / gyro::randomised_arw_deg_rt_h(setup), 1.0, 0.02);
    EXPECT_LT(gyro::randomised_arw_deg_rt_h(setup) / gyro::angle_random_walk_deg_rt_h(setup), 0.972);
}

}  // namespace
}  // namespace noise_effectiveness_test
}  // namespace ringlock::test
