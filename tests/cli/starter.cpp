// ringlock new: scenarios to begin with.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "engine/scenario/devices.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/text.hpp"
#include "tests/cli/program.hpp"

namespace ringlock::test {
namespace starter_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class NewCommand : public ProgramTest {
   protected:
    static std::vector<std::string> all_devices() {
        std::vector<std::string> names = {""};
        for (const scenario::DeviceFile& file : scenario::device_files()) names.emplace_back(file.name);
        return names;
    }
    std::string starter(const std::string& device) const {
        const Outcome r = run(device.empty() ? Arguments{"new"} : Arguments{"new", device});
        EXPECT_EQ(r.status, 0) << r.err;
        EXPECT_EQ(r.err, "");
        return r.out;
    }
};

TEST_F(NewCommand, EachIsTheEmptyScenarioOfItsDevice) {
    for (const std::string& device : all_devices()) {
        const scenario::Scenario empty =
            scenario::parse_string(device.empty() ? "" : "device = \"" + device + "\"\n", "empty");
        EXPECT_TRUE(scenario::parse_string(starter(device), "starter") == empty) << device;
    }
}

TEST_F(NewCommand, AllKeysCanBeUncommented) {
    for (const std::string& device : all_devices()) {
        const std::string text = starter(device);
        const std::string all = std::regex_replace(text, std::regex("(^|\n)#(?=[a-z\\[])"), "$1");
        ASSERT_NE(all, text);
        EXPECT_TRUE(scenario::parse_string(all, "uncommented") == scenario::parse_string(text, "starter")) << device;
        EXPECT_THAT(all, AllOf(HasSubstr("\n[effects.mode_hop]\n"), HasSubstr("\nnotch_bandwidth_hz = ")));
    }
}

TEST_F(NewCommand, EachRuns) {
    for (const std::string& device : all_devices()) {
        Arguments command = {"new", "-o", "s" + device + ".toml"};
        if (!device.empty()) command.push_back(device);
        ASSERT_EQ(run(command).status, 0);
        EXPECT_EQ(run({"validate", "s" + device + ".toml"}).status, 0) << device;
        const Outcome r = run({"run", "s" + device + ".toml", "--set", "ensemble.gyros=2", "--set",
                               "ensemble.duration_s=4", "-o", "out.h5", "--json", "-q"});
        EXPECT_EQ(r.status, 0) << device << ": " << r.err;
        EXPECT_EQ(nlohmann::json::parse(r.out)["arms"].size(), 5U);
        std::filesystem::remove(directory_ / "out.h5");
    }
}

TEST_F(NewCommand, SaysUnitsBoundsAndSources) {
    const std::string text = starter("triangle-51mm");
    EXPECT_THAT(text, AllOf(HasSubstr("\ndevice = \"triangle-51mm\"\n"), HasSubstr("[deg/h]."),
                            HasSubstr("\n#lockin_threshold_deg_h = 150.0\n"), HasSubstr("assumed: ")));
    // A constant of a device is a comment, so that another device can be named; without one it is a key.
    EXPECT_THAT(starter(""), AllOf(HasSubstr("\nlockin_threshold_deg_h = 300.0\n"), Not(HasSubstr("device ="))));
}

TEST_F(NewCommand, RefusesUnknownDevicesAndKeepsFiles) {
    const Outcome unknown = run({"new", "triangle-52mm"});
    EXPECT_EQ(unknown.status, 2);
    EXPECT_EQ(unknown.out, "");
    EXPECT_THAT(unknown.err, AllOf(HasSubstr("triangle-52mm: is not a known device (did you mean \"triangle-51mm\"?)"),
                                   HasSubstr("gao-deng-2007")));
    write("mine.toml", "[gyro]\n");
    const Outcome kept = run({"new", "-o", "mine.toml"});
    EXPECT_EQ(kept.status, 2);
    EXPECT_THAT(kept.err, HasSubstr("mine.toml: is there already"));
    EXPECT_EQ(read("mine.toml"), "[gyro]\n");
    EXPECT_EQ(run({"new", "-o", "mine.txt"}).status, 2);
}

}  // namespace
}  // namespace starter_test
}  // namespace ringlock::test
