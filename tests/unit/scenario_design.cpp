// [design] of a scenario: how it is read, written and refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "engine/core/error.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/render.hpp"

namespace ringlock::scenario {
namespace scenario_design_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string complaint(std::string_view text) {
    try {
        parse_string(text, "s.toml");
    } catch (const InputError& error) {
        return error.what();
    }
    return "(accepted)";
}

constexpr const char* all_forms = R"([design]
kind = "sobol"
points = 8
[[design.vary]]
key = "gyro.lockin_threshold_deg_h"
values = [140, 300.5]
[[design.vary]]
key = "dither.peak_rate_deg_s"
from = 90.0
to = 110.0
points = 5
scale = "log"
[[design.vary]]
key = "input.rate_deg_h"
distribution = "normal"
mean = 0.0
sd = 2.0
[[design.vary]]
key = "gyro.scale_factor_arcsec"
distribution = "triangular"
from = 0.4
mode = 0.5
to = 0.7
[[design.correlation]]
first = "input.rate_deg_h"
second = "gyro.scale_factor_arcsec"
value = 0.5
)";

TEST(ScenarioDesign, IsReadWithEachKeyOfItsForm) {
    const Design design = parse_string(all_forms, "s.toml").design;
    EXPECT_EQ(design.kind, DesignKind::sobol);
    EXPECT_EQ(design.points, 8);
    ASSERT_EQ(design.vary.size(), 4U);
    EXPECT_EQ(design.vary[0].values, (std::vector{140.0, 300.5}));
    EXPECT_EQ(design.vary[1].from, 90.0);
    EXPECT_EQ(design.vary[1].points, 5);
    EXPECT_EQ(design.vary[1].scale, LevelScale::log);
    EXPECT_EQ(design.vary[2].distribution, LotDistribution::normal);
    EXPECT_EQ(design.vary[2].sd, 2.0);
    EXPECT_EQ(design.vary[3].mode, 0.5);
    ASSERT_EQ(design.correlation.size(), 1U);
    EXPECT_EQ(design.correlation[0], (KeyCorrelation{"input.rate_deg_h", "gyro.scale_factor_arcsec", 0.5}));
}

TEST(ScenarioDesign, ResolvedTextParsesBackToAnEqualScenario) {
    const Scenario scenario = parse_string(all_forms, "s.toml");
    EXPECT_EQ(parse_string(to_toml(scenario), "resolved"), scenario);
}

TEST(ScenarioDesign, ASettingTakesThePlaceOfAllTables) {
    const std::vector<std::string> settings{"design.vary=[{key = \"dither.frequency_hz\", values = [1e2, 2e2]}]"};
    const Design design = parse_string(all_forms, "s.toml", settings).design;
    ASSERT_EQ(design.vary.size(), 1U);
    EXPECT_EQ(design.vary[0].key, "dither.frequency_hz");
}

TEST(ScenarioDesign, KeysThatDoNotBelongTogetherAreRefusedWithTheirPlace) {
    const std::string head = "[design]\nkind = \"grid\"\n[[design.vary]]\nkey = \"dither.peak_rate_deg_s\"\n";
    EXPECT_THAT(complaint(head + "values = [1.0]\nfrom = 2.0\n"),
                AllOf(HasSubstr("s.toml:6:8"), HasSubstr("design.vary.from"), HasSubstr("a list of values")));
    EXPECT_THAT(complaint(head + "from = 2.0\n"),
                AllOf(HasSubstr("s.toml:3:1"), HasSubstr("lacks to, points"), HasSubstr("a range")));
    EXPECT_THAT(complaint(head + "distribution = \"normal\"\nmean = 2.0\n"), HasSubstr("lacks sd"));
    EXPECT_THAT(complaint(head + "distribution = \"normal\"\nmean = 2.0\nsd = 1.0\nmode = 1.0\n"),
                HasSubstr("does not belong to a normal distribution, which has the keys key, distribution, mean, sd"));
    EXPECT_THAT(complaint("[[design.vary]]\nvalues = [1.0]\n"), HasSubstr("lacks key"));
    EXPECT_THAT(complaint("[design]\nvary = 3\n"), AllOf(HasSubstr("s.toml:2:1"), HasSubstr("[[design.vary]]")));
    EXPECT_THAT(complaint(head + "value = [1.0]\n"),
                AllOf(HasSubstr("s.toml:5:1"), HasSubstr("unknown key"), HasSubstr("did you mean \"values\"?")));
    EXPECT_THAT(complaint(head + "values = [nan]\n"), HasSubstr("finite"));
    EXPECT_THAT(complaint(head + "distribution = \"gauss\"\n"), HasSubstr("one of \"none\", \"normal\""));
    EXPECT_THAT(complaint("\"design.vary\" = []\n"), HasSubstr("unknown"));
}

TEST(KeyUnits, AreTheEndsOfNames) {
    for (const Section& section : schema()) {
        for (const Key& key : section.keys) EXPECT_FALSE(unit_of(key.name).empty()) << key.path();
    }
    EXPECT_EQ(unit_of("lockin_threshold_deg_h"), "deg/h");
    EXPECT_EQ(unit_of("deg_rt_h"), "deg/sqrt(h)");
    EXPECT_EQ(unit_of("deg_h_rt_h"), "deg/h/sqrt(h)");
    EXPECT_EQ(unit_of("peak_rate_deg_s"), "deg/s");
    EXPECT_EQ(unit_of("drift_2_hz_per_s2"), "Hz/s^2");
    EXPECT_EQ(unit_of("duration_s"), "s");
    EXPECT_EQ(unit_of("temperature_swing_k"), "K");
    EXPECT_EQ(unit_of("relative"), "1");
    EXPECT_EQ(unit_of("resonator_q"), "1");
}

}  // namespace
}  // namespace scenario_design_test
}  // namespace ringlock::scenario
