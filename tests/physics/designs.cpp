// Designs: every point is to the bit the study of its scenario alone, and what is wrong is said before the run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "analysis/study/experiment.hpp"
#include "analysis/study/result/result_file.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/support/open_file.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock {
namespace designs_test {
namespace {

using test::TemporaryDirectory;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

scenario::Scenario parsed(const std::string& text) {
    return scenario::parse_string(text, "s.toml", {}, study::complaints);
}

std::string complaint(const std::string& text) {
    try {
        parsed(text);
    } catch (const InputError& error) {
        return error.what();
    }
    return "(accepted)";
}

/// Two keys, one of which sets the schedule.
constexpr const char* two_keys = R"([ensemble]
gyros = 5
duration_s = 20.0
lockin_threshold_sd_relative = 0.02
[output]
angle_record = false
tau_s = [3.0]
[arms]
names = ["ideal", "uncompensated", "noise_injected", "noise_injected+compensated"]
[effects.quantum_noise]
deg_rt_h = 0.0005
[design]
kind = "grid"
[[design.vary]]
key = "dither.frequency_hz"
values = [120.0, 250.0]
[[design.vary]]
key = "effects.quantum_noise.deg_rt_h"
from = 0.0
to = 0.002
points = 3
)";

void expect_same(const study::GyroStatistics& a, const study::GyroStatistics& b) {
    ASSERT_EQ(a.allan.size(), b.allan.size());
    for (std::size_t i = 0; i < a.allan.size(); ++i) {
        EXPECT_EQ(a.allan[i].tau_s, b.allan[i].tau_s);
        EXPECT_EQ(a.allan[i].dev, b.allan[i].dev);
        EXPECT_EQ(a.allan[i].edf, b.allan[i].edf);
        EXPECT_EQ(a.allan[i].terms, b.allan[i].terms);
        EXPECT_EQ(a.allan[i].alpha, b.allan[i].alpha);
    }
    EXPECT_EQ(a.rate_error_deg_h, b.rate_error_deg_h);
    EXPECT_EQ(a.rate_error_closed_form_deg_h, b.rate_error_closed_form_deg_h);
    EXPECT_EQ(a.change_per_cycle_rad, b.change_per_cycle_rad);
    EXPECT_EQ(a.noise.arw_deg_rt_h.value, b.noise.arw_deg_rt_h.value);
    EXPECT_EQ(a.noise.pooling.arw_best_deg_rt_h, b.noise.pooling.arw_best_deg_rt_h);
    ASSERT_EQ(a.angle_error_arcsec.size(), b.angle_error_arcsec.size());
    for (std::size_t i = 0; i < a.angle_error_arcsec.size(); ++i) {
        if (std::isnan(a.angle_error_arcsec[i]) && std::isnan(b.angle_error_arcsec[i])) continue;
        EXPECT_EQ(a.angle_error_arcsec[i], b.angle_error_arcsec[i]);
    }
}

void expect_same(const study::Study& a, const study::Study& b) {
    EXPECT_EQ(a.scenario, b.scenario);
    EXPECT_EQ(a.factors, b.factors);
    EXPECT_EQ(a.turns, b.turns);
    EXPECT_EQ(a.tables_remade, b.tables_remade);
    EXPECT_EQ(a.turn_map_error_rad, b.turn_map_error_rad);
    ASSERT_EQ(a.gyros.size(), b.gyros.size());
    for (std::size_t g = 0; g < a.gyros.size(); ++g) {
        EXPECT_EQ(a.gyros[g].initial_phase_rad, b.gyros[g].initial_phase_rad);
        EXPECT_EQ(a.gyros[g].lockin_threshold_deg_h, b.gyros[g].lockin_threshold_deg_h);
    }
    ASSERT_EQ(a.arms.size(), b.arms.size());
    for (std::size_t arm = 0; arm < a.arms.size(); ++arm) {
        SCOPED_TRACE(a.arms[arm].arm.name);
        ASSERT_EQ(a.arms[arm].gyros.size(), b.arms[arm].gyros.size());
        for (std::size_t g = 0; g < a.arms[arm].gyros.size(); ++g) {
            expect_same(a.arms[arm].gyros[g], b.arms[arm].gyros[g]);
        }
    }
    ASSERT_EQ(a.predicted_noise.has_value(), b.predicted_noise.has_value());
    if (!a.predicted_noise) return;
    EXPECT_EQ(a.predicted_noise->change_per_cycle_rad, b.predicted_noise->change_per_cycle_rad);
    EXPECT_EQ(a.predicted_noise->arw_over_theory, b.predicted_noise->arw_over_theory);
    EXPECT_EQ(a.predicted_noise->reason, b.predicted_noise->reason);
}

TEST(Designs, APointIsTheScenarioAlone) {
    const study::Experiment planned(parsed(two_keys));
    ASSERT_EQ(planned.points.size(), 6U);
    const study::Experiment all = study::run(planned, 2);
    for (std::size_t point = 0; point < all.points.size(); ++point) {
        SCOPED_TRACE(point);
        scenario::Scenario alone = parsed(two_keys);
        alone.design = {};
        alone.dither.frequency_hz = point < 3 ? 120.0 : 250.0;
        alone.effects["quantum_noise"]["deg_rt_h"] = 0.001 * static_cast<double>(point % 3);
        expect_same(all.points[point], study::run(study::Study(alone), 1));
    }
    EXPECT_NE(all.points[0].factors.size(), all.points[3].factors.size()) << "each has averaging times of its own";
}

TEST(Designs, TheResultFileGivesThemBack) {
    const TemporaryDirectory directory;
    const auto path = directory / "out.h5";
    study::ResultWriter writer(path, study::Experiment(parsed(two_keys)));
    const study::Experiment written = study::run(study::Experiment(parsed(two_keys)), 2);
    writer.finish(written, study::summarise(written), {});
    const study::Experiment read = study::read_result(path);
    EXPECT_EQ(read.scenario, written.scenario);
    ASSERT_EQ(read.axes.size(), 2U);
    EXPECT_EQ(read.axes[1].key, "effects.quantum_noise.deg_rt_h");
    EXPECT_EQ(read.axes[1].unit, "deg/sqrt(h)");
    EXPECT_EQ(read.axes[1].values, (std::vector{0.0, 0.001, 0.002, 0.0, 0.001, 0.002}));
    ASSERT_EQ(read.points.size(), 6U);
    for (std::size_t point = 0; point < 6; ++point) {
        SCOPED_TRACE(point);
        expect_same(read.points[point], written.points[point]);
    }
    // Results of one study may be replaced, those of another may not.
    EXPECT_NO_THROW(study::ResultWriter(path, study::Experiment(parsed(two_keys))));
    const auto other = parsed(std::string(two_keys) + "[gyro]\nlockin_threshold_deg_h = 200\n");
    EXPECT_THROW(study::ResultWriter(path, study::Experiment(other)), InputError);
}

TEST(Designs, KeepRecordsOfAllPointsBelowEachOther) {
    const std::string text = R"([ensemble]
gyros = 3
duration_s = 6.0
[arms]
names = ["uncompensated"]
[design]
kind = "list"
[[design.vary]]
key = "input.rate_deg_h"
values = [5.0, 15.0]
)";
    const TemporaryDirectory directory;
    const auto path = directory / "out.h5";
    const study::Experiment plan(parsed(text));
    study::ResultWriter writer(path, plan);
    std::vector<double> alone;
    const auto done = study::run(plan, 1, [&](const study::SampledAngles& s) {
        writer.write_samples(s);
        if (s.study == 1) alone.insert(alone.end(), s.angle_arcsec.begin(), s.angle_arcsec.end());
    });
    writer.finish(done, study::summarise(done), {});
    const store::File file = test::open_file(path);
    const auto angles = file.group("arms").group("uncompensated").dataset("angle_arcsec");
    EXPECT_EQ(angles.read_rows<double>(3, 3), alone);
}

TEST(Designs, ARateSweepIsOneOfThem) {
    const std::string common = R"([ensemble]
gyros = 2
duration_s = 10.0
[output]
angle_record = false
[arms]
names = ["uncompensated", "noise_injected"]
)";
    const auto design = study::run(study::Experiment(parsed(common + R"([design]
kind = "grid"
[[design.vary]]
key = "input.rate_deg_h"
from = 1.0
to = 9.0
points = 5
)")),
                                   2);
    const auto sweep = study::run(
        study::Study(parsed(common + "[input]\nrate_deg_h = 1.0\nsweep_stop_deg_h = 9.0\nsweep_points = 5\n")), 2);
    for (std::size_t arm = 0; arm < 2; ++arm) {
        for (std::size_t g = 0; g < 10; ++g) {
            EXPECT_EQ(design.points[g / 2].arms[arm].gyros[g % 2].rate_error_deg_h,
                      sweep.arms[arm].gyros[g].rate_error_deg_h);
        }
    }
    const auto lines = study::scale_factors(design);
    const auto summary = study::summarise(sweep);
    ASSERT_EQ(lines.size(), 2U);
    for (std::size_t arm = 0; arm < 2; ++arm) {
        ASSERT_TRUE(lines[arm] && summary.arms[arm].scale_factor);
        EXPECT_EQ(lines[arm]->scatter_deg_h, summary.arms[arm].scale_factor->scatter_deg_h);
        EXPECT_EQ(lines[arm]->scale_factor_ppm.mean, summary.arms[arm].scale_factor->scale_factor_ppm.mean);
    }
}

TEST(Designs, PointsAreComparedInPairs) {
    // Thresholds of a ratio of 2: random walks differ by 2 in first order, of every gyro with the same draws.
    const auto done = study::run(study::Experiment(parsed(R"([ensemble]
gyros = 16
duration_s = 60.0
[output]
angle_record = false
[arms]
names = ["noise_injected"]
[effects.quantum_noise]
deg_rt_h = 0.0
[design]
kind = "list"
[[design.vary]]
key = "gyro.lockin_threshold_deg_h"
values = [150.0, 300.0]
)")),
                                 2);
    const auto ratio = study::arw_over_first(done, study::summarise(done), 1, 0);
    ASSERT_TRUE(ratio && ratio->interval);
    EXPECT_LT(ratio->interval->lo, 2.0);
    EXPECT_GT(ratio->interval->hi, 2.0);
    EXPECT_TRUE(ratio->distinguishable);
}

TEST(Designs, RandomOnesFollowTheSeedAndTheBounds) {
    const auto axes = [](int seed) {
        return study::design_axes(parsed("[ensemble]\nseed = " + std::to_string(seed) + R"(
[output]
angle_record = false
[design]
kind = "latin_hypercube"
points = 64
[[design.vary]]
key = "calibration.threshold_error_relative"
distribution = "normal"
mean = 0.0
sd = 0.1
[[design.vary]]
key = "gyro.lockin_threshold_deg_h"
distribution = "lognormal"
median = 300.0
sd_relative = 0.2
)"));
    };
    const auto first = axes(1);
    ASSERT_EQ(first.size(), 2U);
    EXPECT_EQ(first[0].values, axes(1)[0].values);
    EXPECT_NE(first[0].values, axes(2)[0].values);
    std::vector<double> sorted = first[1].values;
    std::sort(sorted.begin(), sorted.end());
    EXPECT_NEAR(0.5 * (sorted[31] + sorted[32]), 300.0, 3.0);
}

constexpr const char* grid = "[output]\nangle_record = false\n[design]\nkind = \"grid\"\n[[design.vary]]\nkey = ";

TEST(Designs, KeysThatCannotVaryAreRefused) {
    const auto refused = [](const std::string& key) { return complaint(grid + ("\"" + key + "\"\nvalues = [1.0]\n")); };
    EXPECT_THAT(refused("gyro.lockin_treshold_deg_h"), AllOf(HasSubstr("s.toml:6:7"), HasSubstr("is not a key")));
    EXPECT_THAT(refused("readout.model"), HasSubstr("a design varies numbers"));
    EXPECT_THAT(refused("output.angle_record"), HasSubstr("a design varies numbers"));
    EXPECT_THAT(refused("input.profile_time_s"), HasSubstr("a design varies numbers"));
    EXPECT_THAT(refused("ensemble.gyros"), HasSubstr("the same at all points"));
    EXPECT_THAT(refused("ensemble.seed"), HasSubstr("the same at all points"));
    EXPECT_THAT(refused("propagation.direct_tolerance_rad"), HasSubstr("does not vary"));
    EXPECT_THAT(refused("design.points"), HasSubstr("of the design itself"));
    EXPECT_THAT(refused("design.vary.from"), HasSubstr("is not a key"));
    EXPECT_THAT(refused("record.rate_hz"), HasSubstr("ringlock record"));
    EXPECT_THAT(refused("input.sweep_points"), HasSubstr("vary input.rate_deg_h"));
}

TEST(Designs, UnknownKeysAreRefusedWithoutComplaintsToo) {
    scenario::Scenario s;
    s.design.kind = scenario::DesignKind::list;
    s.design.vary = {{.key = "gyro.lockin_treshold_deg_h", .values = {1.0}}};
    EXPECT_THROW(study::Experiment{s}, InputError);
}

TEST(Designs, AllPointsThatBreakARuleAreNamed) {
    const std::string text = complaint(grid + std::string("\"input.rate_deg_h\"\nvalues = [1.0, 3e5, 5.0, 4e5]\n"));
    EXPECT_THAT(text, AllOf(HasSubstr("s.toml:6:7"), HasSubstr("points 2 and 4 of 4, the first"),
                            HasSubstr("input.rate_deg_h = 300000"), HasSubstr("half of the smallest peak rate")));
    EXPECT_THAT(complaint(grid + std::string("\"readout.adc_bits\"\nvalues = [8.0, 8.5]\n")),
                AllOf(HasSubstr("whole number"), HasSubstr("8.5")));
}

TEST(Designs, WhatIsWrongWithADesignIsSaid) {
    const std::string key = "\"gyro.lockin_threshold_deg_h\"\n";
    EXPECT_THAT(complaint(grid + key + "values = [-1.0]\n"), HasSubstr("gyro.lockin_threshold_deg_h"));
    EXPECT_THAT(complaint(grid + key + "distribution = \"normal\"\nmean = 200.0\nsd = 10.0\n"), HasSubstr("grid"));
    EXPECT_THAT(complaint(grid + key + "from = 1.0\nto = 2.0\npoints = 1\n"), HasSubstr("points"));
    const std::string sobol = "[output]\nangle_record = false\n[design]\nkind = \"sobol\"\n";
    const std::string normal = "[[design.vary]]\nkey = " + key + "distribution = \"normal\"\n";
    EXPECT_THAT(complaint(sobol + "points = 8\n" + normal + "mean = -1e4\nsd = 10.0\n"),
                HasSubstr("only 0 of its distribution lies within"));
    EXPECT_THAT(complaint(sobol + normal + "mean = 300.0\nsd = 10.0\n"), HasSubstr("give the number of points"));
    EXPECT_THAT(complaint(sobol + "points = 8\n" + normal + "mean = 300.0\nsd = 0.0\n"), HasSubstr("sd"));
    EXPECT_THAT(complaint(sobol + "points = 1500000\n" + normal + "mean = 300.0\nsd = 10.0\n"),
                AllOf(HasSubstr("design.points"), HasSubstr("of memory, and the machine has")));
    EXPECT_THAT(complaint(sobol + "points = 100000000\n" + normal + "mean = 300.0\nsd = 10.0\n"),
                AllOf(HasSubstr("design.points"), HasSubstr("1562500 is the limit")));
    EXPECT_THAT(complaint("[design]\nkind = \"grid\"\n"), HasSubstr("varies nothing"));
    EXPECT_THAT(complaint("[design]\npoints = 3\n"), HasSubstr("varies nothing"));
    EXPECT_THAT(complaint("[[design.vary]]\nkey = " + key + "values = [100.0]\n"), HasSubstr("set \"grid\""));
    EXPECT_THAT(complaint("[input]\nsweep_points = 3\nsweep_stop_deg_h = 20\n" + std::string(grid) + key +
                          "values = [100.0]\n"),
                HasSubstr("exclude each other"));
    EXPECT_THAT(
        complaint(
            "[design]\nkind = \"grid\"\n[[design.vary]]\nkey = \"ensemble.duration_s\"\nvalues = [100.0, 200.0]\n"),
        HasSubstr("output.angle_record = false"));
    EXPECT_THAT(complaint(sobol + "sensitivity_base_points = 16\npoints = 3\n" + normal + "mean = 300.0\nsd = 10.0\n"),
                HasSubstr("leave design.points out"));
    EXPECT_THAT(complaint(sobol + "sensitivity_base_points = 15\n" + normal + "mean = 300.0\nsd = 10.0\n"),
                AllOf(HasSubstr("design.sensitivity_base_points"), HasSubstr("fewer than 16 base points")));
}

TEST(Designs, AllPointsAskForTheSameFigures) {
    const std::string text = "[ensemble]\nduration_s = 200.0\n" + std::string(grid);
    EXPECT_EQ(complaint(text + "\"specification.angle_error_arcsec\"\nvalues = [5.0, 10.0]\n"), "(accepted)");
    EXPECT_THAT(complaint(text + "\"specification.angle_error_arcsec\"\nvalues = [0.0, 10.0]\n"),
                AllOf(HasSubstr("s.toml:8:7"), HasSubstr("is 0 at some points")));
    EXPECT_THAT(
        complaint("[output]\nangle_record = false\n[specification]\nbias_stability_deg_h = 1.0\n[design]\nkind = "
                  "\"sobol\"\nsensitivity_base_points = 16\n[[design.vary]]\nkey = \"specification.at_s\"\n"
                  "values = [50.0, 100.0]\n"),
        HasSubstr("an index is that of one figure"));
}

}  // namespace
}  // namespace designs_test
}  // namespace ringlock
