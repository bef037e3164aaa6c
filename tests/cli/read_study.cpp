// Studies whose arms are read, on the command line: the reader in the output, and the refusals.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "engine/store/hdf5.hpp"
#include "tests/cli/program.hpp"
#include "tests/support/open_file.hpp"

namespace ringlock {
namespace read_study_test {
namespace {

using nlohmann::json;
using test::Outcome;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr const char* plain = R"([ensemble]
gyros = 4
duration_s = 20.0
[output]
sample_interval_s = 0.2
[arms]
names = ["ideal", "noise_injected+compensated"]
)";
constexpr const char* reader = "[reader]\noutput_hz = 40.0\nfraction = \"none\"\nstripping = \"whole_cycle\"\n";

class ReadStudy : public test::ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        write("s.toml", std::string(plain) + reader);
    }
    /// Status 2, a message, nothing on standard output and no file more.
    void expect_refused(const Arguments& arguments, const testing::Matcher<std::string>& message) const {
        const auto before = left();
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 2) << r.err;
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, AllOf(StartsWith("ringlock: error: "), message));
        EXPECT_EQ(left(), before);
    }
};

TEST_F(ReadStudy, TellsOfItsReader) {
    const Outcome r = run({"run", "s.toml", "-o", "out.h5", "--json"});
    ASSERT_EQ(r.status, 0) << r.err;
    const json found = json::parse(r.out);
    EXPECT_DOUBLE_EQ(found["sample_interval_s"].get<double>(), 0.2);
    EXPECT_EQ(found["reader"]["output_hz"], 40.0);
    EXPECT_EQ(found["reader"]["latch_hz"], 40.0);
    EXPECT_EQ(found["reader"]["fraction"], "none");
    EXPECT_EQ(found["reader"]["stripping"], "whole_cycle");
    EXPECT_NEAR(found["reader"]["delay_s"].get<double>(), 1.0 / (783.4 / (2.0 * 3.141592653589793)), 1e-12);
    EXPECT_EQ(found["reader"]["residue_relative"], 0.0);
    EXPECT_DOUBLE_EQ(found["arms"]["ideal"]["allan"][0]["tau_s"].get<double>(), 0.025);
    EXPECT_EQ(json::parse(run({"analyze", "out.h5", "--json"}).out), found);
    EXPECT_THAT(
        run({"analyze", "out.h5"}).out,
        HasSubstr("arms read at 40 Hz: stripping whole_cycle, fraction none, latched at 40 Hz; 0.00802 s late"));
    EXPECT_THAT(run({"validate", "out.h5"}).out, HasSubstr("a valid result of 4 gyros and 2 arms"));

    const store::File file = test::open_file(directory_ / "out.h5");
    EXPECT_EQ(file.group("arms").group("ideal").dataset("angle_arcsec").shape(), (store::Shape{4, 101}));
}

TEST_F(ReadStudy, WithoutTheKeyNothingIsToldOfAReader) {
    write("plain.toml", std::string(plain) + "[reader]\nfraction = \"none\"\n");
    write("bare.toml", plain);
    const Outcome r = run({"run", "plain.toml", "-o", "out.h5", "--json"});
    ASSERT_EQ(r.status, 0) << r.err;
    EXPECT_FALSE(json::parse(r.out).contains("reader"));
    EXPECT_THAT(run({"analyze", "out.h5"}).out, Not(HasSubstr("arms read at")));
    EXPECT_FALSE(test::open_file(directory_ / "out.h5").has_group("reader"));
    ASSERT_EQ(run({"run", "bare.toml", "-o", "bare.h5"}).status, 0);
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    EXPECT_EQ(h5diff("out.h5", "bare.h5", {"/provenance", "/scenario"}), 0);
}

TEST_F(ReadStudy, TheKeyDoesNotChangeARecord) {
    const std::string record = "[record]\nkind = \"samples\"\nrate_hz = 80.0\n";
    write("with.toml", std::string(plain) + reader + "latch_hz = 80.0\n" + record);
    std::string without = std::string(reader).replace(std::string(reader).find("output_hz = 40.0\n"), 17, "");
    write("without.toml", plain + without + "latch_hz = 80.0\n" + record);
    const Outcome r = run({"record", "with.toml", "-o", "with.h5"});
    ASSERT_EQ(r.status, 0) << r.err;
    ASSERT_EQ(run({"record", "without.toml", "-o", "without.h5"}).status, 0);
    if (!has_h5diff()) GTEST_SKIP() << "h5diff (hdf5-tools) is missing";
    EXPECT_EQ(h5diff("with.h5", "without.h5", {}), 0);
}

TEST_F(ReadStudy, RefusesReadersThatDoNotFit) {
    const auto refused = [&](const std::string& set, const testing::Matcher<std::string>& message) {
        expect_refused({"run", "s.toml", "-o", "out.h5", "--set", set}, message);
    };
    refused("reader.latch_hz=50", AllOf(HasSubstr("reader.latch_hz"), HasSubstr("not a whole multiple of the 40 Hz at "
                                                                                "which the arms of a study are read")));
    refused("reader.output_hz=1", AllOf(HasSubstr("s.toml:5:21: key \"output.sample_interval_s\" = 0.2: "),
                                        HasSubstr("at least one output of the reader apart, 1 s")));
    refused("reader.stripping=none", AllOf(HasSubstr("reader.stripping"), HasSubstr("set another stripping")));
    refused("reader.output_hz=-1", AllOf(HasSubstr("reader.output_hz"), HasSubstr("0 or between 0.001 and 1e6")));
    write("bad.toml", std::string(plain) + "[reader]\noutput_hz = 40.0\nlatch_hz = 50.0\n");
    expect_refused({"run", "bad.toml", "-o", "out.h5"}, HasSubstr("bad.toml:10:12: key \"reader.latch_hz\" = 50.0: "));
    write("slow.toml", "[ensemble]\nduration_s = 20\n[reader]\noutput_hz = 0.1\n[output]\nsample_interval_s = 10.0\n");
    expect_refused({"run", "slow.toml", "-o", "out.h5"},
                   AllOf(HasSubstr("slow.toml:2:14: key \"ensemble.duration_s\""), HasSubstr("at least 3 samples")));
    write("design.toml", std::string(plain) +
                             "[design]\nkind = \"list\"\n[[design.vary]]\n"
                             "key = \"reader.latch_hz\"\nvalues = [0, 80]\n");
    expect_refused({"run", "design.toml", "-o", "out.h5"},
                   AllOf(HasSubstr("design.vary[1].key"), HasSubstr("set reader.output_hz, too")));
}

TEST_F(ReadStudy, PointsOfADesignHaveReadersOfTheirOwn) {
    write("d.toml", std::string(plain) + reader +
                        "[design]\nkind = \"list\"\n[[design.vary]]\nkey = \"reader.latch_hz\"\nvalues = [0, 80]\n");
    const Outcome r = run({"run", "d.toml", "-o", "d.h5", "--json"});
    ASSERT_EQ(r.status, 0) << r.err;
    const json points = json::parse(r.out)["design"]["points"];
    EXPECT_EQ(points[0]["reader"]["latch_hz"], 40.0);
    EXPECT_EQ(points[1]["reader"]["latch_hz"], 80.0);
    write("d.toml", std::string(plain) + reader +
                        "[design]\nkind = \"list\"\n[[design.vary]]\nkey = \"reader.output_hz\"\nvalues = [40, 80]\n");
    expect_refused({"run", "d.toml", "-o", "other.h5"}, HasSubstr("set output.angle_record = false"));
}

TEST_F(ReadStudy, IsNotReplayed) {
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5"}).status, 0);
    expect_refused({"replay", "out.h5", "--arm", "ideal", "--gyro", "1"},
                   AllOf(HasSubstr("out.h5: its arms were read by readers (reader.output_hz = 40)"),
                         HasSubstr("--set reader.output_hz=0")));
}

TEST_F(ReadStudy, TimesBelowASampleWantARunThatHasThem) {
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5"}).status, 0);
    expect_refused({"analyze", "out.h5", "--tau", "0.1s"}, HasSubstr("from an output of the reader (0.025 s) on"));
}

}  // namespace
}  // namespace read_study_test
}  // namespace ringlock
