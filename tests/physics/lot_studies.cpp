// What a study tells of its gyros as a lot: random walks of all arms, deviations asked for, yields, quantiles, pairs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "analysis/study/summary.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/scenario/check.hpp"

namespace ringlock::test {
namespace lot_studies_test {
namespace {

scenario::Scenario short_study(const std::vector<std::string>& arms) {
    scenario::Scenario scenario;
    scenario.ensemble.gyros = 16;
    scenario.ensemble.duration_s = 120.0;
    scenario.arms = scenario::parse_arms(arms);
    return scenario;
}

study::Study simulated(const scenario::Scenario& scenario) { return study::run(study::Study(scenario), 2); }

const study::ArmSummary& named(const study::Summary& summary, const std::string& name) {
    return *std::find_if(summary.arms.begin(), summary.arms.end(), [&](const auto& arm) { return arm.name == name; });
}

TEST(LotStudies, EveryArmHasTheRandomWalkThatItsRecordsShow) {
    constexpr double quantum_deg_rt_h = 0.0015;
    scenario::Scenario scenario = short_study({"ideal", "compensated_exact", "noise_injected"});
    scenario.ensemble.duration_s = 600.0;
    scenario.effects["quantum_noise"]["deg_rt_h"] = quantum_deg_rt_h;
    const study::Summary summary = study::summarise(simulated(scenario));
    for (const char* name : {"ideal", "compensated_exact", "noise_injected"}) {
        const study::ArmSummary& arm = named(summary, name);
        EXPECT_EQ(arm.arw_reason, "") << name;
        ASSERT_TRUE(arm.arw_deg_rt_h.median) << name;
        const double lockin = arm.noise_injected ? summary.theory.arw_deg_rt_h : 0.0;
        EXPECT_DOUBLE_EQ(arm.arw_theory.lockin_deg_rt_h, lockin) << name;
        ASSERT_EQ(arm.arw_theory.effects_deg_rt_h.size(), 1U) << name;
        EXPECT_EQ(arm.arw_theory.effects_deg_rt_h.front().first, "quantum_noise");
        EXPECT_NEAR(arm.arw_theory.effects_deg_rt_h.front().second, quantum_deg_rt_h, 1e-12);
        EXPECT_NEAR(arm.arw_theory.total_deg_rt_h, std::hypot(lockin, quantum_deg_rt_h), 1e-12) << name;
        // N of a record of n samples has a relative standard error of some 1/sqrt(n); the median of 16 is 1.25/4 of it.
        const double error = 1.25 / std::sqrt(16.0 * 600.0);
        EXPECT_NEAR(*arm.arw_deg_rt_h.median / arm.arw_theory.total_deg_rt_h, 1.0, 4.0 * error) << name;
    }
    // The share of the lock-in alone is what the effectiveness of the noise is about.
    const auto& noise = named(summary, "noise_injected").noise_effectiveness;
    ASSERT_TRUE(noise && noise->measured.arw_over_theory);
    EXPECT_NEAR(*noise->measured.arw_over_theory, 1.0, 0.08);
}

TEST(LotStudies, ArmsWithoutRandomWalkSayWhy) {
    scenario::Scenario scenario = short_study({"ideal", "uncompensated"});
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    const study::Summary summary = study::summarise(simulated(scenario));
    for (const study::ArmSummary& arm : summary.arms) {
        EXPECT_FALSE(arm.arw_deg_rt_h.median || arm.arw_deg_rt_h.hi) << arm.name;
        EXPECT_NE(arm.arw_reason.find("nothing random"), std::string::npos) << arm.arw_reason;
        EXPECT_EQ(arm.arw_theory.total_deg_rt_h, 0.0);
    }
    EXPECT_TRUE(summary.pairs.empty());
}

TEST(LotStudies, DeviationsStandAtTheTimesAskedFor) {
    scenario::Scenario scenario = short_study({"noise_injected"});
    scenario.output.tau_s = {20.0, 0.5, 7.3};
    const study::Study study = simulated(scenario);
    const study::Summary summary = study::summarise(study);
    EXPECT_TRUE(std::is_sorted(study.factors.begin(), study.factors.end()));
    for (const double tau_s : scenario.output.tau_s) {
        const std::int64_t m = ensemble::outputs_in(study.schedule, tau_s);
        const auto place = std::find(study.factors.begin(), study.factors.end(), m);
        ASSERT_NE(place, study.factors.end()) << tau_s;
        const auto at = static_cast<std::size_t>(place - study.factors.begin());
        const study::EnsemblePoint& point = summary.arms[0].allan[at];
        EXPECT_NEAR(point.tau_s, tau_s, 0.5 * study.schedule.output_s);
        // White rate noise: the deviation goes as 1/sqrt(tau).
        const double expected = summary.theory.arw_deg_rt_h / std::sqrt(point.tau_s / 3600.0);
        EXPECT_NEAR(point.dev_deg_h / expected, 1.0, 4.0 / std::sqrt(2.0 * point.edf)) << tau_s;
    }
}

TEST(LotStudies, YieldsCountTheRecordsWithinEveryLimit) {
    scenario::Scenario scenario = short_study({"noise_injected", "noise_injected+compensated"});
    scenario.specification.arw_deg_rt_h = 0.00225;
    scenario.specification.bias_stability_deg_h = 0.03;
    scenario.specification.at_s = 20.0;
    scenario.specification.rate_error_deg_h = 0.01;
    scenario.specification.angle_error_arcsec = 0.4;
    scenario.specification.after_s = 60.0;
    const study::Study study = simulated(scenario);
    const study::Summary summary = study::summarise(study);
    for (std::size_t a = 0; a < study.arms.size(); ++a) {
        const auto& arm = study.arms[a];
        ASSERT_TRUE(summary.arms[a].yield);
        const study::Yield& yield = *summary.arms[a].yield;
        const auto walks = study::random_walks_deg_rt_h(arm);
        std::int64_t all = 0;
        std::int64_t by_limit[4] = {};
        for (std::size_t g = 0; g < arm.gyros.size(); ++g) {
            const auto& gyro = arm.gyros[g];
            const auto at = std::find_if(gyro.allan.begin(), gyro.allan.end(), [&](const allan::Point& p) {
                return p.m == ensemble::outputs_in(study.schedule, 20.0);
            });
            const bool passes[] = {walks[g] <= 0.00225, at->dev <= 0.03, std::abs(gyro.rate_error_deg_h) <= 0.01,
                                   std::abs(gyro.angle_error_arcsec.back()) <= 0.4};
            for (std::size_t k = 0; k < 4; ++k) by_limit[k] += passes[k] ? 1 : 0;
            all += passes[0] && passes[1] && passes[2] && passes[3] ? 1 : 0;
        }
        EXPECT_EQ(yield.share.k, all);
        EXPECT_EQ(yield.share.n, 16);
        ASSERT_EQ(yield.limits.size(), 4U);
        for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(yield.limits[k].share.k, by_limit[k]) << yield.limits[k].name;
        const auto worst = std::min_element(std::begin(by_limit), std::end(by_limit)) - std::begin(by_limit);
        EXPECT_EQ(yield.fails_most, by_limit[worst] == 16 ? "" : yield.limits[static_cast<std::size_t>(worst)].name);
    }
    EXPECT_EQ(summary.arms[1].yield->share.k, 16) << "compensation meets what noise alone does not";
    EXPECT_LT(summary.arms[0].yield->share.k, 16);
}

/// A sweep of five gyros that is planned only, with these rate errors [deg/h], [rate][gyro].
study::Study made_by_hand(const std::vector<std::vector<double>>& errors_deg_h) {
    scenario::Scenario scenario = short_study({"ideal"});
    scenario.ensemble.gyros = static_cast<std::int64_t>(errors_deg_h.front().size());
    scenario.input.rate_deg_h = 100.0;
    scenario.input.sweep_stop_deg_h = 300.0;
    scenario.input.sweep_points = static_cast<std::int64_t>(errors_deg_h.size());
    scenario.specification.rate_error_deg_h = 0.05;
    scenario.specification.scale_factor_error_ppm = 100.0;
    study::Study study(scenario);
    std::size_t row = 0;
    for (const std::vector<double>& rate : errors_deg_h) {
        for (const double error : rate) study.arms[0].gyros[row++].rate_error_deg_h = error;
    }
    return study;
}

TEST(LotStudies, GyrosOfASweepPassAtAllRatesTogether) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    // A bias alone; a slope of 50 ppm; one of -150 ppm; a deviation at the middle rate, without slope; a rate that is
    // not there.
    const study::Study study = made_by_hand({{0.04, 0.005, -0.015, 0.0, 0.0},  // at 100 deg/h
                                             {0.04, 0.010, -0.030, 0.06, 0.0},
                                             {0.04, 0.015, -0.045, 0.0, nan}});
    EXPECT_EQ(study::passed_gyros(study, study.arms[0]), (std::vector<bool>{true, true, false, false, false}));
    const study::Yield yield = study::yield_of(study, study.arms[0]);
    EXPECT_EQ(yield.share.k, 2);
    EXPECT_EQ(yield.share.n, 5) << "gyros, not records";
    ASSERT_EQ(yield.limits.size(), 2U);
    EXPECT_EQ(yield.limits[0].name, "rate_error_deg_h");
    EXPECT_EQ(yield.limits[0].share.k, 3) << "all but the deviation and the missing rate";
    EXPECT_EQ(yield.limits[1].name, "scale_factor_error_ppm");
    EXPECT_EQ(yield.limits[1].most, 100.0);
    EXPECT_EQ(yield.limits[1].share.k, 3) << "all but -150 ppm and the missing rate";
    EXPECT_EQ(yield.limits[1].share.n, 5);
    // Clopper-Pearson of 2 of 5.
    ASSERT_TRUE(yield.share.interval);
    EXPECT_NEAR(yield.share.interval->lo, 0.0527, 1e-4);
    EXPECT_NEAR(yield.share.interval->hi, 0.8534, 1e-4);
}

TEST(LotStudies, OneGyroHasAScaleFactorToo) {
    // Locked: it reads nothing, and its slope is off by all of the rate.
    study::Study study = made_by_hand({{-100.0}, {-200.0}, {-300.0}});
    study.scenario.specification.rate_error_deg_h = 0.0;
    EXPECT_EQ(study::yield_of(study, study.arms[0]).share.k, 0);
    study.scenario.specification.scale_factor_error_ppm = 1e6 * (1.0 + 1e-12);  // rounding
    EXPECT_EQ(study::yield_of(study, study.arms[0]).share.k, 1);
}

TEST(LotStudies, AScaleFactorIsSpecifiedOfASweepOfThreeRatesOnly) {
    scenario::Scenario scenario = short_study({"ideal"});
    scenario.specification.scale_factor_error_ppm = 5.0;
    const auto complaints = [&] { return scenario::check(scenario); };
    for (const std::int64_t points : {1, 2}) {
        scenario.input.sweep_points = points;
        scenario.input.sweep_stop_deg_h = points == 1 ? scenario.input.rate_deg_h : 60.0;
        ASSERT_EQ(complaints().size(), 1U);
        EXPECT_EQ(complaints()[0].keys,
                  (std::vector<std::string>{"specification.scale_factor_error_ppm", "input.sweep_points"}));
        EXPECT_NE(complaints()[0].problem.find("set input.sweep_points to 3 or more"), std::string::npos)
            << complaints()[0].problem;
    }
    scenario.input.sweep_points = 3;
    EXPECT_TRUE(complaints().empty());
}

TEST(LotStudies, AngleErrorsGrowAsTheRandomWalkSays) {
    scenario::Scenario scenario = short_study({"noise_injected"});
    scenario.ensemble.gyros = 64;
    const study::Study study = simulated(scenario);
    const double walk = study::summarise(study).theory.arw_deg_rt_h;
    for (std::size_t i = 0; i < study.angle_times_s.size(); ++i) {
        double square = 0.0;
        for (const auto& gyro : study.arms[0].gyros) square += std::pow(gyro.angle_error_arcsec[i], 2) / 64.0;
        const double expected = 3600.0 * walk * std::sqrt(study.angle_times_s[i] / 3600.0);
        EXPECT_NEAR(std::sqrt(square) / expected, 1.0, 4.0 / std::sqrt(2.0 * 64.0)) << study.angle_times_s[i];
    }
}

TEST(LotStudies, EffectsFollowAProfileOfTheTemperature) {
    scenario::Scenario scenario = short_study({"ideal"});
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.effects["bias_temperature"]["deg_h_per_k"] = 0.5;
    scenario.environment.profile_time_s = {0.0, 40.0, 80.0};
    scenario.environment.profile_temperature_k = {293.0, 297.0, 291.0};
    const study::Study study = simulated(scenario);
    // The mean of the change over [0, 40, 80, end]: 2 K, then 1 K, then -2 K.
    const double end_s = study.schedule.output_s * static_cast<double>(study.schedule.outputs() - 1);
    const double mean_k = (40.0 * 2.0 + 40.0 * 1.0 - (end_s - 80.0) * 2.0) / end_s;
    // Readings of the angle by interpolated detectors are wrong by a small part of a fringe at either end.
    const double reading_deg_h = 0.05 * scenario.gyro.scale_factor_arcsec / end_s;
    for (const auto& gyro : study.arms[0].gyros) EXPECT_NEAR(gyro.rate_error_deg_h, 0.5 * mean_k, reading_deg_h);
}

TEST(LotStudies, QuantilesOfSmallLotsHaveNoOuterEnds) {
    const study::Summary summary = study::summarise(simulated(short_study({"noise_injected"})));
    ASSERT_FALSE(summary.arms[0].lot.empty());
    const study::LotFigure& walks = summary.arms[0].lot.front();
    EXPECT_EQ(walks.name, "arw_deg_rt_h");
    ASSERT_EQ(walks.quantiles.size(), 3U);
    EXPECT_FALSE(walks.quantiles[0].lo);
    EXPECT_TRUE(walks.quantiles[1].lo && walks.quantiles[1].hi);
    EXPECT_FALSE(walks.quantiles[2].hi);
    EXPECT_LT(*walks.quantiles[0].value, *walks.quantiles[2].value);
}

TEST(LotStudies, ArmsAreComparedGyroByGyro) {
    const std::vector<std::string> arms{"noise_injected", "noise_injected+compensated_published",
                                        "noise_injected+compensated"};
    scenario::Scenario scenario = short_study(arms);
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    const study::Summary summary = study::summarise(simulated(scenario));
    ASSERT_EQ(summary.pairs.size(), 3U);
    const study::ArmPair& cured = summary.pairs[1];
    EXPECT_EQ(cured.first, arms[0]);
    EXPECT_EQ(cured.second, arms[2]);
    EXPECT_TRUE(cured.arw_deg_rt_h.ratio.distinguishable);
    EXPECT_GT(*cured.arw_deg_rt_h.ratio.value, 100.0);
    // As printed, the correction turns the error round: the random walk of every gyro stays.
    EXPECT_NEAR(*summary.pairs[0].arw_deg_rt_h.ratio.value, 1.0, 0.05);
}

TEST(LotStudies, NoiseThatDoesNotRandomiseIsSaid) {
    scenario::Scenario scenario = short_study({"noise_injected"});
    scenario.input.rate_deg_h = scenario.input.sweep_stop_deg_h = 1.0;
    EXPECT_EQ(study::summarise(simulated(scenario)).arms[0].noise_effectiveness->not_randomised, "");
    scenario.noise_injection.model = scenario::NoiseModel::drive;
    scenario.noise_injection.resonator_q = 300.0;
    const std::string why = study::summarise(simulated(scenario)).arms[0].noise_effectiveness->not_randomised;
    EXPECT_NE(why.find("random walk is 2.3"), std::string::npos) << why;
    EXPECT_NE(why.find("bias of -0.31 deg/h"), std::string::npos) << why;
}

TEST(LotStudies, AnAngleAtTheEndIsToldThoughTheRecordIsOfWholeSamples) {
    // Samples of ten seconds of the paper's device are 1247 cycles: the record ends before the 60 s asked for.
    scenario::Scenario scenario = short_study({"ideal"});
    scenario.ensemble.duration_s = 60.0;
    scenario.output.sample_interval_s = 10.0;
    scenario.output.angle_after_s = {60.0};
    scenario.specification.angle_error_arcsec = 1e6;
    scenario.specification.after_s = 60.0;
    const study::Study study = simulated(scenario);
    ASSERT_LT(study.schedule.output_s * static_cast<double>(study.schedule.outputs() - 1), 60.0);
    ASSERT_EQ(study.angle_times_s.size(), 5U);
    EXPECT_FALSE(study.angle_output(2)) << "100 s";
    EXPECT_EQ(study.angle_output(3), study.schedule.outputs() - 1);
    for (const study::GyroStatistics& gyro : study.arms[0].gyros) {
        EXPECT_TRUE(std::isnan(gyro.angle_error_arcsec[2]));
        EXPECT_TRUE(std::isfinite(gyro.angle_error_arcsec[3]));
        EXPECT_EQ(gyro.angle_error_arcsec[3], gyro.angle_error_arcsec[4]);
    }
    EXPECT_EQ(study::summarise(study).arms[0].yield->share.k, 16);
}

}  // namespace
}  // namespace lot_studies_test
}  // namespace ringlock::test
