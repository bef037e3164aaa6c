#include <gmock/gmock.h>

#include <algorithm>

#include "engine/core/error.hpp"
#include "engine/gyro/theory.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/devices.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/render.hpp"
#include "tests/support/devices.hpp"
#include "tests/support/expect_throw.hpp"

namespace ringlock::scenario {
namespace scenario_devices_test {
namespace {

using test::message_of;
using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;
using testing::StartsWith;

std::string complaint(const std::string& text) {
    return message_of<InputError>([&] { parse_string(text, "s.toml"); });
}

TEST(Devices, AreValidScenariosWithASourceForEachConstant) {
    ASSERT_FALSE(device_files().empty());
    const Scenario paper;
    for (const DeviceFile& file : device_files()) {
        SCOPED_TRACE(std::string(file.name));
        const NamedDevice device = read_device(file);
        EXPECT_NE(device.summary, "");
        EXPECT_EQ(device.scenario.device, file.name);
        std::vector<std::string> with_source;
        for (const ValueSource& source : device.sources) {
            with_source.push_back(source.key);
            EXPECT_THAT(source.text, AnyOf(StartsWith("published: "), StartsWith("derived: "), StartsWith("assumed: ")))
                << source.key;
        }
        // Each of the four constants that the first-order theory needs is in the file and has its source; nothing else.
        EXPECT_THAT(with_source,
                    testing::UnorderedElementsAre("gyro.scale_factor_arcsec", "gyro.lockin_threshold_deg_h",
                                                  "dither.frequency_hz", "dither.peak_rate_deg_s"));
        for (const std::string& key : with_source) {
            EXPECT_THAT(std::string(file.text), HasSubstr('\n' + key.substr(key.find('.') + 1) + " = ")) << key;
        }
    }
}

TEST(Devices, HaveTheScaleFactorsOfTheirPaths) {
    // K = lambda L/(4 A), recalculated from the size in the name; the paper's device is the only one without.
    constexpr double wavelength_m = 632.8e-9;
    int checked = 0;
    for (const DeviceFile& file : device_files()) {
        const std::string name(file.name);
        const std::size_t dash = name.find('-');
        const bool triangle = name.substr(0, dash) == "triangle";
        if (!triangle && name.substr(0, dash) != "square") continue;
        const double side_m = 1e-3 * std::stod(name.substr(dash + 1));
        const double k_rad = (triangle ? std::sqrt(3.0) : 1.0) * wavelength_m / side_m;
        const double k_arcsec = k_rad * 180.0 / units::pi * 3600.0;
        // Names give whole millimetres; sides are of inches.
        EXPECT_NEAR(read_device(file).scenario.gyro.scale_factor_arcsec / k_arcsec, 1.0, 0.02) << name;
        ++checked;
    }
    EXPECT_EQ(checked, 8);
}

TEST(Devices, AreTheOnesThatTheTurnMapIsHeldAgainst) {
    for (const test::NamedDevice& named : test::named_devices) {
        const DeviceFile* file = find_device(named.name);
        ASSERT_NE(file, nullptr) << named.name;
        const gyro::Setup here = configured_setup(read_device(*file).scenario);
        const gyro::Setup there = test::setup_of(named);
        EXPECT_NEAR(gyro::modulation_depth_rad(here) / gyro::modulation_depth_rad(there), 1.0, 0.005) << named.name;
        EXPECT_NEAR(gyro::turn_kick_rad(here) / gyro::turn_kick_rad(there), 1.0, 0.01) << named.name;
    }
    EXPECT_EQ(device_files().size(), test::named_devices.size());
}

TEST(Devices, GiveDefaultsThatAScenarioOverridesKeyByKey) {
    const Scenario s = parse_string(
        "device = \"triangle-51mm\"\n[gyro]\nlockin_threshold_deg_h = 99.0\n[ensemble]\ngyros = 7\n", "s.toml");
    EXPECT_EQ(s.gyro.scale_factor_arcsec, 4.4503);
    EXPECT_EQ(s.gyro.lockin_threshold_deg_h, 99.0);
    EXPECT_EQ(s.dither.frequency_hz, 400.0);
    EXPECT_EQ(s.ensemble.gyros, 7);
    EXPECT_EQ(s.input.rate_deg_h, Scenario{}.input.rate_deg_h);
}

TEST(Devices, ThePapersIsTheDefault) {
    const Scenario s = parse_string("device = \"gao-deng-2007\"\n", "s.toml");
    Scenario paper;
    paper.device = s.device;
    EXPECT_EQ(to_toml(s), to_toml(paper));
}

TEST(Devices, ComeBackFromTheTextOfAScenario) {
    const std::string text = "device = \"square-70mm\"\n[dither]\nfrequency_hz = 512.0\n";
    const Scenario s = parse_string(text, "s.toml");
    const Scenario again = parse_string(to_toml(s), "again.toml");
    EXPECT_EQ(to_toml(again), to_toml(s));
    EXPECT_EQ(again.device, "square-70mm");
    EXPECT_EQ(again.dither.frequency_hz, 512.0);
}

TEST(Devices, UnknownOnesAreRefusedWithTheKnown) {
    EXPECT_THAT(complaint("\ndevice = \"triangle-52mm\"\n"),
                AllOf(HasSubstr("s.toml:2:10: key \"device\" = \"triangle-52mm\""), HasSubstr("did you mean"),
                      HasSubstr("triangle-51mm"), HasSubstr("gao-deng-2007"), HasSubstr("square-90mm")));
    EXPECT_THAT(complaint("device = 3\n"), AllOf(HasSubstr("s.toml:1:10: key \"device\" = 3"), HasSubstr("name")));
    EXPECT_THAT(complaint("devise = \"triangle-51mm\"\n"), AllOf(HasSubstr("devise"), HasSubstr("device")));
    EXPECT_THAT(complaint("[device]\nname = \"triangle-51mm\"\n"), HasSubstr("device"));
    EXPECT_THAT(complaint("[gyro]\ndevice = \"triangle-51mm\"\n"), HasSubstr("gyro.device"));
}

TEST(Devices, ErrorsNameOnlyKeysOfTheScenario) {
    // The fault lies in the input rate alone; the dither that it exceeds is of the device's file.
    EXPECT_THAT(complaint("device = \"triangle-51mm\"\n[input]\nrate_deg_h = 200000.0\n"),
                AllOf(HasSubstr("s.toml:3:14: key \"input.rate_deg_h\""), testing::Not(HasSubstr("triangle-51mm:"))));
}

}  // namespace
}  // namespace scenario_devices_test
}  // namespace ringlock::scenario
