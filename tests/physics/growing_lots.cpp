// Lots that grow until they are precise, gyros that are switched on several times, and the keys that decide.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "analysis/study/experiment.hpp"
#include "analysis/study/result/result_file.hpp"
#include "analysis/study/sensitivity.hpp"
#include "engine/core/error.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/scenario/check.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock::test {
namespace growing_lots_test {
namespace {

using testing::HasSubstr;

scenario::Scenario growing() {
    scenario::Scenario s;
    s.ensemble.duration_s = 40.0;
    s.ensemble.lockin_threshold_sd_relative = 0.05;
    s.output.angle_record = false;
    s.arms = scenario::parse_arms({"noise_injected", "noise_injected+compensated"});
    s.stop.arw_relative = 0.1;
    return s;
}

TEST(GrowingLots, AreThoseOfAFixedNumberOfGyros) {
    scenario::Scenario scenario = growing();
    scenario.stop.arw_relative = 0.05;
    const study::Experiment grown = study::run(study::Experiment(scenario), 2);
    ASSERT_TRUE(grown.growth);
    EXPECT_TRUE(grown.growth->precise) << grown.growth->why;
    const std::int64_t reached = grown.growth->looks.back();
    ASSERT_GT(reached, 16) << "the first look must not be the last, or nothing was tested";
    EXPECT_EQ(grown.scenario.ensemble.gyros, reached);
    scenario.stop = {};
    scenario.ensemble.gyros = reached;
    const study::Study fixed = study::run(study::Study(scenario), 1);
    const study::Study& lot = grown.points.front();
    ASSERT_EQ(lot.gyros.size(), fixed.gyros.size());
    EXPECT_EQ(lot.turns, fixed.turns);
    EXPECT_EQ(lot.turn_map_error_rad, fixed.turn_map_error_rad);
    for (std::size_t arm = 0; arm < fixed.arms.size(); ++arm) {
        for (std::size_t g = 0; g < fixed.gyros.size(); ++g) {
            EXPECT_EQ(lot.arms[arm].gyros[g].rate_error_deg_h, fixed.arms[arm].gyros[g].rate_error_deg_h);
            EXPECT_EQ(lot.arms[arm].gyros[g].allan.back().dev, fixed.arms[arm].gyros[g].allan.back().dev);
        }
    }
    for (const study::ArmSummary& arm : study::summarise(lot).arms) {
        ASSERT_TRUE(arm.arw_mean_deg_rt_h.relative_half_width) << arm.name;
        EXPECT_LE(*arm.arw_mean_deg_rt_h.relative_half_width, 0.05) << arm.name;
    }
}

TEST(GrowingLots, EndAtTheMostGyrosAndSaySo) {
    scenario::Scenario scenario = growing();
    scenario.stop.arw_relative = 1e-4;
    scenario.stop.most_gyros = 20;
    const study::Experiment grown = study::run(study::Experiment(scenario), 2);
    EXPECT_FALSE(grown.growth->precise);
    EXPECT_EQ(grown.growth->looks, (std::vector<std::int64_t>{16, 20}));
    EXPECT_EQ(grown.points.front().gyros.size(), 20U);
}

TEST(GrowingLots, EndAfterTheMostHoursAtALook) {
    scenario::Scenario scenario = growing();
    scenario.stop.arw_relative = 1e-4;
    scenario.stop.most_hours = 1e-9;
    const study::Experiment grown = study::run(study::Experiment(scenario), 2);
    EXPECT_EQ(grown.growth->looks, (std::vector<std::int64_t>{16}));
    EXPECT_THAT(grown.growth->why, HasSubstr("stop.most_hours"));
}

TEST(GrowingLots, AllPointsOfADesignGrowTogether) {
    scenario::Scenario scenario = growing();
    scenario.stop.arw_relative = 0.2;
    scenario.design.kind = scenario::DesignKind::list;
    scenario.design.vary = {{.key = "gyro.lockin_threshold_deg_h", .values = {200.0, 400.0}}};
    const study::Experiment grown = study::run(study::Experiment(scenario), 2);
    for (const study::Study& point : grown.points) {
        EXPECT_EQ(static_cast<std::int64_t>(point.gyros.size()), grown.growth->looks.back());
    }
}

TEST(GrowingLots, ResultsKeepWhyTheyStopped) {
    const TemporaryDirectory directory;
    const auto path = directory / "out.h5";
    scenario::Scenario scenario = growing();
    scenario.stop.most_gyros = 24;
    for (int i = 0; i < 2; ++i) {  // the second takes the place of the first
        study::ResultWriter writer(path, study::Experiment(scenario));
        const auto grown = study::run(study::Experiment(scenario), 2);
        writer.finish(grown, study::summarise(grown), {});
        const auto read = study::read_result(path);
        ASSERT_TRUE(read.growth);
        EXPECT_EQ(read.growth->looks, grown.growth->looks);
        EXPECT_EQ(read.growth->why, grown.growth->why);
        EXPECT_EQ(read.growth->precise, grown.growth->precise);
        EXPECT_EQ(read.points.front().gyros.size(), grown.points.front().gyros.size());
    }
    scenario.gyro.lockin_threshold_deg_h = 200.0;
    EXPECT_THROW(study::ResultWriter(path, study::Experiment(scenario)), InputError);
}

std::string complaint(const scenario::Scenario& s) {
    const auto found = scenario::check(s);
    return found.empty() ? "" : found.front().keys.front() + ": " + found.front().problem;
}

TEST(GrowingLots, RefuseWhatCannotGrow) {
    EXPECT_EQ(complaint(growing()), "");
    scenario::Scenario s = growing();
    s.output.angle_record = true;
    EXPECT_THAT(complaint(s), HasSubstr("output.angle_record"));
    s = growing();
    s.input.sweep_points = 3;
    s.input.sweep_stop_deg_h = 20.0;
    EXPECT_THAT(complaint(s), HasSubstr("input.sweep_points"));
    s = growing();
    s.stop.yield_absolute = 0.02;
    EXPECT_THAT(complaint(s), HasSubstr("[specification]"));
    s = growing();
    s.ensemble.turn_ons = 3;
    EXPECT_THAT(complaint(s), HasSubstr("must divide 16"));
    s.stop = {};
    s.ensemble.gyros = 16;
    EXPECT_THAT(complaint(s), HasSubstr("16 gyros are not a whole number of gyros with 3 turn-ons"));
}

TEST(TurnOns, KeepTheGyroAndDrawTheRestAnew) {
    scenario::Scenario s;
    s.ensemble.gyros = 12;
    s.ensemble.turn_ons = 3;
    s.ensemble.lockin_threshold_sd_relative = 0.1;
    for (std::int64_t g = 0; g < 12; ++g) {
        const auto setup = ensemble::draw_setup(s, g);
        const auto first = ensemble::draw_setup(s, g - g % 3);
        EXPECT_EQ(setup.lockin_threshold_deg_h, first.lockin_threshold_deg_h);
        EXPECT_EQ(setup.dither_asymmetry_ratio, first.dither_asymmetry_ratio);
        EXPECT_EQ(setup.dither_peak_rate_deg_s, first.dither_peak_rate_deg_s);
        if (g % 3 == 0) continue;
        EXPECT_NE(setup.initial_phase_rad, first.initial_phase_rad);
    }
    EXPECT_NE(ensemble::draw_setup(s, 0).lockin_threshold_deg_h, ensemble::draw_setup(s, 3).lockin_threshold_deg_h);
}

TEST(TurnOns, AGyroMeetsTheSpecificationWhereAllItsTurnOnsDo) {
    scenario::Scenario s;
    s.ensemble.gyros = 6;
    s.ensemble.turn_ons = 2;
    s.arms = scenario::parse_arms({"ideal"});
    s.specification.rate_error_deg_h = 1.0;
    study::Study study(s);
    const std::vector<double> errors{0.5, -0.5, 0.5, 1.5, -1.5, 1.5};
    for (std::size_t g = 0; g < 6; ++g) study.arms[0].gyros[g].rate_error_deg_h = errors[g];
    EXPECT_EQ(study::passed_gyros(study, study.arms[0]), (std::vector<bool>{true, false, false}));
    const study::Yield yield = study::yield_of(study, study.arms[0]);
    EXPECT_EQ(yield.share.k, 1);
    EXPECT_EQ(yield.share.n, 3);
}

TEST(TurnOns, RepeatabilityLeavesOutWhatDiffersBetweenGyros) {
    // Biases of the published compensator differ from gyro to gyro with the asymmetry; here they are made large by
    // hand, and what is left within a gyro is known.
    study::Study study = [] {
        scenario::Scenario s;
        s.ensemble.gyros = 8;
        s.ensemble.turn_ons = 2;
        s.arms = scenario::parse_arms({"ideal"});
        return study::Study(s);
    }();
    const std::vector<double> within{0.3, -0.1, 0.2, 0.4};  // differences of the two turn-ons
    for (std::size_t g = 0; g < 8; ++g) {
        auto& gyro = study.arms[0].gyros[g];
        const double half = 0.5 * within[g / 2];
        gyro.rate_error_deg_h = 100.0 * static_cast<double>(g / 2) + (g % 2 == 0 ? half : -half);
        gyro.angle_error_arcsec.assign(study.angle_times_s.size(), 0.0);
    }
    const auto found = study::turn_on_repeatability(study, study.arms[0]);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->degrees_of_freedom, 4);
    // Each pair has squares d^2/2 about its mean.
    EXPECT_NEAR(found->sd_deg_h, std::sqrt((0.09 + 0.01 + 0.04 + 0.16) / 2.0 / 4.0), 1e-12);
    // sd sqrt(4/chi2) with the 97.5 and 2.5 % points of four degrees of freedom, 11.1433 and 0.484419.
    EXPECT_NEAR(found->interval.lo, found->sd_deg_h * std::sqrt(4.0 / 11.143287), 1e-6);
    EXPECT_NEAR(found->interval.hi, found->sd_deg_h * std::sqrt(4.0 / 0.4844186), 1e-5);
    study.scenario.ensemble.turn_ons = 1;
    EXPECT_FALSE(study::turn_on_repeatability(study, study.arms[0]));
    const auto scatter = study::scatter_of_averages(study, study.arms[0]);
    ASSERT_EQ(scatter.size(), 4U) << "1, 10, 100 s and the whole record";
    EXPECT_EQ(scatter[0].scatter.sd_deg_h, 0.0);
    EXPECT_GT(scatter.back().scatter.sd_deg_h, 100.0);
}

TEST(LongDecidingKeys, TheThresholdDecidesTheRandomWalkAndTheCalibrationTheCompensated) {
    // Randomised turns have a random walk in proportion to the threshold, and the lock-in that a compensator with a
    // wrong threshold leaves goes with the error of the threshold.
    scenario::Scenario s;
    s.ensemble.gyros = 4;
    s.ensemble.duration_s = 64.0;
    s.output.angle_record = false;
    s.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    s.arms = scenario::parse_arms({"noise_injected", "noise_injected+compensated"});
    s.design.kind = scenario::DesignKind::sobol;
    s.design.sensitivity_base_points = 32;
    s.design.vary = {{.key = "gyro.lockin_threshold_deg_h",
                      .distribution = scenario::LotDistribution::lognormal,
                      .median = 300.0,
                      .sd_relative = 0.3},
                     {.key = "calibration.threshold_error_relative",
                      .from = -0.3,
                      .to = 0.3,
                      .distribution = scenario::LotDistribution::uniform}};
    const study::Experiment done = study::run(study::Experiment(s), 2);
    EXPECT_EQ(done.points.size(), 32U * 4U);
    const auto found = study::sensitivity(done);
    ASSERT_EQ(found.size(), 2U);
    ASSERT_EQ(found[0].figures[0].name, "log_arw_deg_rt_h");
    const design::OutputIndices& raw = found[0].figures[0].indices;
    ASSERT_EQ(raw.factors.size(), 2U) << raw.absent;
    EXPECT_GT(raw.factors[0].total.estimate, 0.8);
    EXPECT_NEAR(raw.factors[1].total.estimate, 0.0, 1e-12) << "a compensator's calibration changes nothing without it";
    ASSERT_TRUE(raw.noise_share);
    EXPECT_LT(*raw.noise_share, 0.5);
    const design::OutputIndices& compensated = found[1].figures[0].indices;
    ASSERT_EQ(compensated.factors.size(), 2U) << compensated.absent;
    EXPECT_GT(compensated.factors[1].total.estimate, compensated.factors[0].total.estimate);
}

}  // namespace
}  // namespace growing_lots_test
}  // namespace ringlock::test
