// The gyros that the program knows, from the command line.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/cli/program.hpp"

namespace ringlock {
namespace devices_test {
namespace {

using nlohmann::json;
using test::Outcome;
using testing::HasSubstr;

class DevicesCommand : public test::ProgramTest {};

TEST_F(DevicesCommand, ListsEachWithItsFigures) {
    const Outcome table = run({"devices"});
    EXPECT_EQ(table.status, 0) << table.err;
    const Outcome text = run({"devices", "--json"});
    ASSERT_EQ(text.status, 0) << text.err;
    const json devices = json::parse(text.out)["devices"];
    ASSERT_GE(devices.size(), 9U);
    for (const json& device : devices) {
        EXPECT_THAT(table.out, HasSubstr(device["name"].get<std::string>()));
        for (const char* key : {"scale_factor_arcsec", "lockin_threshold_deg_h", "dither_frequency_hz",
                                "dither_peak_rate_deg_s", "fringes_per_half_cycle", "kick_rad", "modulation_depth_rad",
                                "arw_deg_rt_h", "largest_dead_band_deg_h"}) {
            EXPECT_GT(device[key].get<double>(), 0.0) << device["name"] << " " << key;
        }
        EXPECT_EQ(device["sources"].size(), 4U) << device["name"];
    }
}

TEST_F(DevicesCommand, EachRunsAsAScenario) {
    const json all = json::parse(run({"devices", "--json"}).out)["devices"];
    ASSERT_FALSE(all.empty());
    for (const json& device : all) {
        const std::string name = device["name"];
        write(name + ".toml", "device = \"" + name + "\"\n[ensemble]\ngyros = 2\nduration_s = 4.0\n");
        const Outcome r = run({"run", name + ".toml", "-o", name + ".h5", "--json"});
        EXPECT_EQ(r.status, 0) << name << "\n" << r.err;
    }
}

TEST_F(DevicesCommand, UnknownDeviceIsRefusedWithTheKnown) {
    write("s.toml", "device = \"square-71mm\"\n");
    const Outcome r = run({"validate", "s.toml"});
    EXPECT_EQ(r.status, 2);
    EXPECT_THAT(r.err, HasSubstr("s.toml:1:10: key \"device\" = \"square-71mm\""));
    EXPECT_THAT(r.err, HasSubstr("square-70mm"));
}

}  // namespace
}  // namespace devices_test
}  // namespace ringlock
