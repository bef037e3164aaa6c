// Designs, stopping rules and sensitivity indices from the command line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/cli/program.hpp"
#include "tests/cli/result_data.hpp"

namespace ringlock {
namespace design_test {
namespace {

using nlohmann::json;
using test::data;
using test::Outcome;
using test::same_bits;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

/// Three gyros for some seconds at each of six points, with angle records.
constexpr const char* grid = R"([ensemble]
gyros = 3
duration_s = 40.0
[arms]
names = ["ideal", "uncompensated", "noise_injected", "noise_injected+compensated"]
[specification]
arw_deg_rt_h = 0.0025
[design]
kind = "grid"
[[design.vary]]
key = "gyro.lockin_threshold_deg_h"
values = [150, 300]
[[design.vary]]
key = "noise_injection.turn_phase_rms_rad"
from = 2
to = 4
points = 3
)";

/// A lot that is precise enough at its second look.
constexpr const char* growing = R"([ensemble]
duration_s = 40.0
[output]
angle_record = false
[arms]
names = ["noise_injected", "noise_injected+compensated"]
[stop]
arw_relative = 0.08
most_gyros = 64
[design]
kind = "list"
[[design.vary]]
key = "gyro.lockin_threshold_deg_h"
values = [200, 300]
)";

class DesignCommand : public test::ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        write("d.toml", grid);
    }
    json printed(const Arguments& arguments) const {
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 0) << r.err;
        return json::parse(r.out);
    }
    /// Bad input: status 2, nothing on standard output, no file left.
    void expect_refused(const Arguments& arguments, const testing::Matcher<std::string>& message) const {
        const auto before = left();
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 2) << arguments[0] << "\n" << r.err;
        EXPECT_EQ(r.out, "") << arguments[0];
        EXPECT_THAT(r.err, AllOf(StartsWith("ringlock: error: "), message)) << arguments[0];
        EXPECT_EQ(left(), before) << arguments[0];
    }
};

void expect_narrow(const std::string& text) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100U) << line;
}

TEST_F(DesignCommand, TableHasThePointsAndTheFigureIsDrawn) {
    const Outcome r = run({"run", "d.toml", "--quiet", "--plot", "d.svg"});
    ASSERT_EQ(r.status, 0) << r.err;
    EXPECT_EQ(r.err, "");
    for (const char* text :
         {"6 points of 3 gyros", "[1] gyro.lockin_threshold_deg_h [deg/h]", "[2] noise_injection.turn_phase_rms_rad",
          "(4) noise_injected+compensated", "Angle random walk", "Mean rate less the input rate", "specification"}) {
        EXPECT_THAT(r.out, HasSubstr(text));
    }
    expect_narrow(r.out);
    EXPECT_THAT(r.out, AllOf(Not(HasSubstr("nan")), Not(HasSubstr("inf "))));
    EXPECT_THAT(read("d.svg"), AllOf(HasSubstr("<svg"), HasSubstr("6 points of 3 gyros")));
    EXPECT_EQ(left(), (std::set<std::string>{"d.h5", "d.svg", "d.toml"}));
    EXPECT_EQ(run({"validate", "d.h5"}).out, "d.h5: a valid result of 6 points, 18 gyros and 4 arms\n");
    const Outcome again = run({"analyze", "d.h5", "--plot", "again.svg"});
    ASSERT_EQ(again.status, 0) << again.err;
    EXPECT_EQ(again.out, r.out);
    EXPECT_EQ(read("again.svg"), read("d.svg"));
}

TEST_F(DesignCommand, ManyKeysAndArmsStayWithinThePage) {
    std::string text =
        "[ensemble]\ngyros = 2\nduration_s = 20.0\n[output]\nangle_record = false\n[design]\n"
        "kind = \"sobol\"\npoints = 2\n";
    for (const char* key :
         {"gyro.lockin_threshold_deg_h", "input.rate_deg_h", "dither.frequency_hz",
          "noise_injection.turn_phase_rms_rad", "effects.quantum_noise.deg_rt_h",
          "calibration.threshold_error_relative", "effects.bias_temperature.deg_h_per_k",
          "ensemble.lockin_threshold_sd_relative", "ensemble.dither_amplitude_sd_relative", "dither.peak_rate_deg_s"}) {
        const std::string name = key;
        const bool large = name.starts_with("dither") || name.starts_with("gyro");
        text += "[[design.vary]]\nkey = \"" + name + "\"\ndistribution = \"uniform\"\n" +
                (large ? "from = 123.45678\nto = 150.0\n" : "from = 0.000123456\nto = 0.01\n");
    }
    write("many.toml", text);
    const Outcome r = run({"run", "many.toml"});
    ASSERT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, AllOf(HasSubstr("\nKeys\n"), HasSubstr("[10]")));
    expect_narrow(r.out);
}

TEST_F(DesignCommand, JsonHasThePointsWithTheirValuesAndArms) {
    const json out = printed({"run", "d.toml", "--json", "--quiet"});
    EXPECT_FALSE(out.contains("stop"));
    EXPECT_FALSE(out.contains("arms")) << "arms are those of the points";
    const json& design = out["design"];
    EXPECT_EQ(design["keys"], (json{{{"key", "gyro.lockin_threshold_deg_h"}, {"unit", "deg/h"}},
                                    {{"key", "noise_injection.turn_phase_rms_rad"}, {"unit", "rad"}}}));
    ASSERT_EQ(design["points"].size(), 6U);
    for (std::size_t p = 0; p < 6; ++p) {
        SCOPED_TRACE(p);
        const json& point = design["points"][p];
        // The last key varies fastest.
        EXPECT_EQ(point["values"], (json{{"gyro.lockin_threshold_deg_h", p < 3 ? 150.0 : 300.0},
                                         {"noise_injection.turn_phase_rms_rad", 2.0 + static_cast<double>(p % 3)}}));
        // The dead band goes with the threshold, in first order; that of the paper's 300 deg/h is 2.632 deg/h.
        EXPECT_NEAR(point["theory"]["dead_band_deg_h"], p < 3 ? 2.632 / 2.0 : 2.632, 1e-3);
        ASSERT_EQ(point["arms"].size(), 4U);
        for (const auto& [name, arm] : point["arms"].items()) {
            SCOPED_TRACE(name);
            EXPECT_EQ(arm["gyros"], 3);
            EXPECT_EQ(arm["yield"]["gyros"], 3);
            EXPECT_TRUE(arm["rate_error_deg_h"]["mean"].is_number());
            EXPECT_TRUE(arm.contains("arw_over_first_point"));
            EXPECT_FALSE(arm.contains("asked"));
        }
        EXPECT_TRUE(point["pairs"].is_array());
    }
    EXPECT_EQ(design["points"][0]["arms"]["ideal"]["arw_over_first_point"]["value"], 1.0);
    EXPECT_FALSE(design.contains("sensitivity"));
    EXPECT_EQ(printed({"analyze", "d.h5", "--json"}), out);
}

TEST_F(DesignCommand, APointIsTheRunOfItsScenario) {
    json point = printed({"run", "d.toml", "--json"})["design"]["points"][4];
    std::string alone = grid;
    alone.resize(alone.find("[design]"));
    write("alone.toml", alone + "[noise_injection]\nturn_phase_rms_rad = 3\n[gyro]\nlockin_threshold_deg_h = 300\n");
    const json single = printed({"run", "alone.toml", "--json"});
    for (auto& arm : point["arms"]) arm.erase("arw_over_first_point");
    EXPECT_EQ(point["arms"], single["arms"]);
    EXPECT_EQ(point["theory"], single["theory"]);
    EXPECT_EQ(point["pairs"], single["pairs"]);
}

TEST_F(DesignCommand, AnalyzeTakesDeviationsOfEveryPointFromAngleRecords) {
    ASSERT_EQ(run({"run", "d.toml"}).status, 0);
    const json found = printed({"analyze", "d.h5", "--json", "--tau", "5s", "--dev", "mdev"});
    ASSERT_EQ(found["design"]["points"].size(), 6U);
    std::set<double> seen;
    for (const json& point : found["design"]["points"]) {
        for (const auto& [name, arm] : point["arms"].items()) {
            SCOPED_TRACE(name);
            ASSERT_EQ(arm["asked"].size(), 1U);
            EXPECT_NEAR(arm["asked"][0]["tau_s"], 5.0, 0.02) << "whole cycles of the dither, whole samples";
            EXPECT_GT(arm["asked"][0]["dev_deg_h"], arm["asked"][0]["lo"]);
            EXPECT_LT(arm["asked"][0]["dev_deg_h"], arm["asked"][0]["hi"]);
            ASSERT_EQ(arm["deviations"].size(), 1U);
            EXPECT_FALSE(arm["deviations"]["mdev"].empty());
        }
        seen.insert(point["arms"]["noise_injected"]["asked"][0]["dev_deg_h"].get<double>());
    }
    EXPECT_EQ(seen.size(), 6U) << "each point has records of its own";
    const Outcome table = run({"analyze", "d.h5", "--tau", "5s", "--dev", "mdev"});
    ASSERT_EQ(table.status, 0) << table.err;
    for (const char* text : {"Point 1:", "Point 6:", "at the averaging times asked for", "mdev [deg/h]"}) {
        EXPECT_THAT(table.out, HasSubstr(text));
    }
}

TEST_F(DesignCommand, DesignsThatCannotBeAreRefused) {
    const auto refused = [&](const std::string& from, const std::string& to, auto... parts) {
        SCOPED_TRACE(to);
        std::string text = grid;
        text.replace(text.find(from), from.size(), to);
        write("bad.toml", text);
        expect_refused({"run", "bad.toml", "-o", "out.h5"}, AllOf(HasSubstr(parts)...));
        expect_refused({"validate", "bad.toml"}, AllOf(HasSubstr(parts)...));
    };
    refused("150, 300", "-150, 300", "bad.toml:12:10", "gyro.lockin_threshold_deg_h", "-150");
    refused("gyro.lockin_threshold_deg_h", "gyro.lockin_treshold_deg_h", "bad.toml:11:7", "is not a key");
    refused("points = 3", "points = 0", "bad.toml:15:8", "noise_injection.turn_phase_rms_rad", "a range of 0 points");
    refused("\"grid\"", "\"grit\"", "bad.toml:9:8", "grit", "latin_hypercube");
    refused("points = 3", "points = 3\nvalue = 2", "bad.toml:18:1", "value");
}

TEST_F(DesignCommand, SettingsOfTheCommandLineReachTheDesign) {
    expect_refused({"run", "d.toml", "--set", "design.points=4"}, HasSubstr("--set design.points=4: "));
    std::string text = grid;
    text.replace(text.find("\"grid\""), 6, "\"sobol\"\npoints = 4");
    const std::string range = "values = [150, 300]";
    text.replace(text.find(range), range.size(), "distribution = \"uniform\"\nfrom = 150\nto = 300");
    text.replace(text.find("points = 3"), 10, "distribution = \"uniform\"");
    write("s.toml", text);
    EXPECT_EQ(printed({"run", "s.toml", "--json"})["design"]["points"].size(), 4U);
    const json two = printed({"run", "s.toml", "--json", "--set", "design.points=2", "-o", "two.h5"});
    ASSERT_EQ(two["design"]["points"].size(), 2U);
    for (const json& point : two["design"]["points"]) {
        EXPECT_GE(point["values"]["gyro.lockin_threshold_deg_h"], 150.0);
        EXPECT_LE(point["values"]["gyro.lockin_threshold_deg_h"], 300.0);
    }
    expect_refused({"run", "s.toml", "--set", "design.points=-1"}, HasSubstr("--set design.points=-1: "));
}

TEST_F(DesignCommand, DataAreTheSameToTheBitForAnyNumberOfThreads) {
    for (const char* threads : {"1", "2", "5"}) {
        const Outcome r = run({"run", "d.toml", "-o", std::string(threads) + ".h5", "--threads", threads});
        ASSERT_EQ(r.status, 0) << r.err;
    }
    const auto one = data(directory_ / "1.h5");
    EXPECT_GT(one.size(), 100U);
    for (const char* other : {"2.h5", "5.h5"}) {
        const auto found = data(directory_ / other);
        ASSERT_EQ(found.size(), one.size());
        for (const auto& [name, values] : one) EXPECT_TRUE(same_bits(values, found.at(name))) << other << name;
    }
    if (!has_h5diff()) GTEST_SKIP() << "h5diff is not there (hdf5-tools)";
    EXPECT_EQ(h5diff("1.h5", "2.h5", {"/provenance"}), 0);
    EXPECT_EQ(h5diff("1.h5", "5.h5", {"/provenance"}), 0);
}

TEST_F(DesignCommand, ALotThatGrewIsThatOfAFixedNumberOfGyros) {
    write("g.toml", growing);
    const json grown = printed({"run", "g.toml", "--json", "--quiet"});
    const json& stop = grown["stop"];
    ASSERT_EQ(stop["gyros"], 32) << "neither the first look nor the last, or little was tested: " << stop["why"];
    EXPECT_EQ(stop["looks"], (json{16, 32}));
    EXPECT_EQ(stop["precise"], true);
    EXPECT_THAT(stop["why"].get<std::string>(), HasSubstr("precise enough with 32 gyros"));
    EXPECT_EQ(printed({"analyze", "g.h5", "--json"}), grown);
    const Outcome table = run({"analyze", "g.h5"});
    EXPECT_THAT(table.out, HasSubstr("stopped at 32 gyros: "));
    expect_narrow(table.out);

    // The same without the table [stop].
    std::string fixed = growing;
    const std::size_t begin = fixed.find("[stop]");
    fixed.erase(begin, fixed.find("[design]") - begin);
    write("fixed.toml", fixed);
    EXPECT_FALSE(printed({"run", "fixed.toml", "--json", "--set", "ensemble.gyros=32"}).contains("stop"));
    auto expected = data(directory_ / "fixed.h5");
    auto found = data(directory_ / "g.h5");
    EXPECT_EQ(found.erase("/stop/looks") + found.erase("/stop@precise"), 2U);
    // Intervals after a stop are wider; what cannot be told apart with them may be without.
    const auto fixed_lo = expected.extract("/pairs/arw_ratio_lo").mapped();
    const auto fixed_hi = expected.extract("/pairs/arw_ratio_hi").mapped();
    const auto grown_lo = found.extract("/pairs/arw_ratio_lo").mapped();
    const auto grown_hi = found.extract("/pairs/arw_ratio_hi").mapped();
    EXPECT_EQ(found.erase("/pairs/arw_distinguishable") + expected.erase("/pairs/arw_distinguishable"), 2U);
    EXPECT_LT(grown_lo[1], fixed_lo[1]);
    EXPECT_GT(grown_hi[1], fixed_hi[1]);
    ASSERT_EQ(found.size(), expected.size());
    for (const auto& [name, values] : expected) EXPECT_TRUE(same_bits(values, found.at(name))) << name;
    if (!has_h5diff()) GTEST_SKIP() << "h5diff is not there (hdf5-tools)";
    EXPECT_EQ(h5diff("g.h5", "fixed.h5", {"/provenance", "/stop", "/scenario", "/pairs"}), 0);
}

TEST_F(DesignCommand, AStopNamesTheFiguresThatAreFurthestFromTheirGoal) {
    std::string text = growing;
    text.replace(text.find("[200, 300]"), 10, "[200, 220, 240, 260, 280, 300]");
    text.replace(text.find("0.08"), 4, "1e-4");
    text.replace(text.find("most_gyros = 64"), 15, "most_gyros = 16");
    write("g.toml", text);
    const json grown = printed({"run", "g.toml", "--json"});
    EXPECT_EQ(grown["stop"]["precise"], false);
    EXPECT_THAT(grown["stop"]["why"].get<std::string>(),
                AllOf(HasSubstr("not precise enough yet"), testing::EndsWith(" more")));
    expect_narrow(run({"analyze", "g.h5"}).out);
}

TEST_F(DesignCommand, SensitivityDesignsPrintIndicesOfEveryKey) {
    write("i.toml", R"([ensemble]
gyros = 2
duration_s = 40.0
[output]
angle_record = false
[arms]
names = ["noise_injected", "noise_injected+compensated"]
[design]
kind = "sobol"
sensitivity_base_points = 16
[[design.vary]]
key = "gyro.lockin_threshold_deg_h"
distribution = "lognormal"
median = 300
sd_relative = 0.3
[[design.vary]]
key = "calibration.threshold_error_relative"
distribution = "uniform"
from = -0.3
to = 0.3
)");
    const json out = printed({"run", "i.toml", "--json"});
    EXPECT_EQ(out["design"]["points"].size(), 16U * 4U);
    const json& sensitivity = out["design"]["sensitivity"];
    ASSERT_EQ(sensitivity.size(), 2U);
    for (const auto& [arm, figures] : sensitivity.items()) {
        SCOPED_TRACE(arm);
        for (const char* figure : {"log_arw_deg_rt_h", "rate_error_deg_h"}) {
            ASSERT_TRUE(figures.contains(figure));
            const json& one = figures[figure];
            EXPECT_EQ(one["base_points"], 16);
            ASSERT_TRUE(one["absent"].is_null()) << one["absent"];
            ASSERT_EQ(one["keys"].size(), 2U);
            for (const auto& [key, indices] : one["keys"].items()) {
                for (const char* order : {"first", "total"}) {
                    EXPECT_LE(indices[order]["lo"], indices[order]["value"]) << key << order;
                    EXPECT_GE(indices[order]["hi"], indices[order]["value"]) << key << order;
                }
            }
        }
    }
    // A compensator's calibration changes nothing where there is none.
    EXPECT_NEAR(sensitivity["noise_injected"]["log_arw_deg_rt_h"]["keys"]["calibration.threshold_error_relative"]
                           ["total"]["value"],
                0.0, 1e-12);
    EXPECT_EQ(printed({"analyze", "i.h5", "--json"}), out);
    const Outcome table = run({"analyze", "i.h5"});
    for (const char* text :
         {"noise_injected+compensated, log_arw_deg_rt_h: Sobol' indices", "first order", "total order",
          "calibration.threshold_error_relative", "Only some of the points are shown"}) {
        EXPECT_THAT(table.out, HasSubstr(text));
    }
    expect_narrow(table.out);
}

}  // namespace
}  // namespace design_test
}  // namespace ringlock
