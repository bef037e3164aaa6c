#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/support/scenario_complaint.hpp"

namespace ringlock::scenario {
namespace scenario_errors_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

std::string file_complaint(const std::filesystem::path& path) {
    try {
        parse_file(path);
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

TEST(ScenarioText, AnEmptyOneIsTheDefault) {
    EXPECT_EQ(parse_string("", "s.toml"), Scenario{});
    EXPECT_EQ(parse_string("# nothing\n[gyro]\n[effects]\n", "s.toml"), Scenario{});
}

std::string setting_complaint(const std::vector<std::string>& settings) {
    try {
        parse_string("[gyro]\nlockin_threshold_deg_h = 200\n", "s.toml", settings);
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

TEST(ScenarioSettings, StandInPlaceOfWhatTheFileSays) {
    const std::vector<std::string> settings{
        "gyro.lockin_threshold_deg_h=140",         "readout.model=instrument",  "readout.phase_from = \"detectors\"",
        "effects.bias_step.step_deg_h=-0.5",       "output.angle_record=false", "ensemble.gyros=4",
        "arms.names=[\"ideal\", \"compensated\"]", "ensemble.gyros=8"};
    const Scenario s =
        parse_string("[gyro]\nlockin_threshold_deg_h = 200\nscale_factor_arcsec = 1\n", "s.toml", settings);
    EXPECT_EQ(s.gyro.lockin_threshold_deg_h, 140.0);
    EXPECT_EQ(s.gyro.scale_factor_arcsec, 1.0);
    EXPECT_EQ(s.readout.model, ReadoutModel::instrument);
    EXPECT_EQ(s.readout.phase_from, PhaseFrom::detectors);
    EXPECT_EQ(s.effects.at("bias_step").at("step_deg_h"), -0.5);
    EXPECT_FALSE(s.output.angle_record);
    EXPECT_EQ(s.ensemble.gyros, 8) << "the later one of two";
    EXPECT_EQ(s.arms, parse_arms({"ideal", "compensated"}));
}

TEST(ScenarioSettings, OfADeviceLeaveTheFilesKeys) {
    const std::vector<std::string> settings{"device=triangle-51mm"};
    const Scenario s =
        parse_string("device = \"square-90mm\"\n[gyro]\nlockin_threshold_deg_h = 7\n", "s.toml", settings);
    const Scenario device = parse_string("device = \"triangle-51mm\"\n", "s.toml");
    EXPECT_EQ(s.device, "triangle-51mm");
    EXPECT_EQ(s.gyro.scale_factor_arcsec, device.gyro.scale_factor_arcsec);
    EXPECT_EQ(s.gyro.lockin_threshold_deg_h, 7.0);
}

TEST(ScenarioSettings, AreRefusedWithTheirText) {
    EXPECT_THAT(setting_complaint({"gyro.lockin_threshold_deg_h=-1"}),
                StartsWith("--set gyro.lockin_threshold_deg_h=-1: key \"gyro.lockin_threshold_deg_h\" = -1: must be "));
    EXPECT_THAT(setting_complaint({"gyro.lockin_treshold_deg_h=1"}), HasSubstr("did you mean"));
    EXPECT_THAT(setting_complaint({"readout.model=instrumnt"}), HasSubstr("did you mean"));
    EXPECT_THAT(setting_complaint({"device=square"}),
                AllOf(StartsWith("--set device=square: "), HasSubstr("square-90mm")));
    EXPECT_THAT(setting_complaint({"ensemble.gyros=two"}), HasSubstr("must be a whole number"));
    EXPECT_THAT(setting_complaint({"gyro=1"}), HasSubstr("must be a table"));
    // A rule that a setting breaks is told at the setting, not at a line of the file.
    EXPECT_THAT(setting_complaint({"input.rate_deg_h=1e6"}), StartsWith("--set input.rate_deg_h=1e6: "));
    for (const char* wrong : {"", "gyro", "=1", "gyro.lockin_threshold_deg_h=", "gyro.lockin_threshold_deg_h= ",
                              "gyro.lockin_threshold_deg_h=1\nensemble.gyros=2", "gyro.lockin_threshold_deg_h=1 # x",
                              "gyro.lockin_threshold_deg_h=1, 2", "gyro.=1", "a b=1", "gyro.x=[1", "gyro.x=\"1"}) {
        EXPECT_THAT(setting_complaint({wrong}), StartsWith("--set ")) << wrong;
    }
    std::string dots = "a";
    for (int i = 0; i < 40000; ++i) dots += ".a";
    EXPECT_THAT(setting_complaint({dots + "=1"}), HasSubstr("parts"));
}

TEST(ScenarioText, SetsWhatItNames) {
    const Scenario s = parse_string(
        "gyro.lockin_threshold_deg_h = 200\n"
        "[readout]\nmodel = \"ideal\"\nangle_output = \"quarter_fringe\"\nclock_hz = 0\n"
        "[ensemble]\ngyros = 8\nseed = 9223372036854775807\n"
        "[effects.bias_step]\nstep_deg_h = -0.5\n"
        "[arms]\nnames = [\"ideal\", \"compensated\"]\n"
        "[output]\nangle_record = false\n"
        "[propagation]\nmethod = \"direct\"\n",
        "s.toml");
    EXPECT_EQ(s.gyro.lockin_threshold_deg_h, 200.0);
    EXPECT_EQ(s.readout.model, ReadoutModel::ideal);
    EXPECT_EQ(s.readout.angle_output, AngleOutput::quarter_fringe);
    EXPECT_EQ(s.readout.clock_hz, 0.0);
    EXPECT_EQ(s.ensemble.gyros, 8);
    EXPECT_EQ(s.ensemble.seed, 9223372036854775807U);
    EXPECT_EQ(s.effects.at("bias_step").at("step_deg_h"), -0.5);
    EXPECT_EQ(s.effects.at("bias_step").at("time_s"), 0.0);
    EXPECT_EQ(s.arms, parse_arms({"ideal", "compensated"}));
    EXPECT_FALSE(s.output.angle_record);
    EXPECT_EQ(s.propagation.method, PropagationMethod::direct);
}

struct BadCase {
    const char* title;
    const char* text;
    const char* message;
    friend void PrintTo(const BadCase& bad, std::ostream* out) { *out << bad.title; }
};

class BadScenario : public testing::TestWithParam<BadCase> {};

TEST_P(BadScenario, IsRefusedWithPlaceKeyValueAndWhatIsAllowed) {
    const std::string found = complaint(GetParam().text);
    EXPECT_THAT(found, HasSubstr(GetParam().message));
    EXPECT_THAT(found, Not(HasSubstr("\n"))) << "one problem, one line";
}

const BadCase bad_cases[] = {
    {"BelowTheBound", "[ensemble]\ngyros = -3\n",
     "s.toml:2:9: key \"ensemble.gyros\" = -3: must be between 1 and 10000000 (a study needs a gyro"},
    {"AboveTheBound", "[dither]\nfrequency_hz = 2e5",
     "s.toml:2:16: key \"dither.frequency_hz\" = 200000.0: must be "
     "between 1 and 100000 ("},
    {"AtAnExcludedBound", "[dither]\npeak_rate_deg_s = 0",
     "s.toml:2:19: key \"dither.peak_rate_deg_s\" = 0: must be above "
     "0 and at most 10000 ("},
    {"NegativePeakRate", "[dither]\npeak_rate_deg_s = -1.5", "\"dither.peak_rate_deg_s\" = -1.5: must be above 0"},
    {"BetweenZeroAndTheBound", "[readout]\nclock_hz = 10.5",
     "s.toml:2:12: key \"readout.clock_hz\" = 10.5: must be 0 or between 1000 and 1e12 (0 is continuous time)"},
    {"NegativeSeed", "[ensemble]\nseed = -1",
     "s.toml:2:8: key \"ensemble.seed\" = -1: must be between 0 and 9223372036854775807"},
    {"PhaseSpread", "[ensemble]\ninitial_phase_spread_rad = 6.3", "must be between 0 and 6.283185307179586"},
    {"SpreadThatReachesZero", "[ensemble]\nlockin_threshold_sd_relative = 0.2",
     "\"ensemble.lockin_threshold_sd_relative\" = 0.2: must be between 0 and 0.16 (six sigma must not reach zero)"},
    {"Tolerance", "[propagation]\nturn_map_tolerance_rad = 0", "must be between 1e-12 and 0.001"},
    {"EffectOutOfBounds", "[effects.quantum_noise]\ndeg_rt_h = -1",
     "s.toml:2:12: key \"effects.quantum_noise.deg_rt_h\" = -1: must be between 0 and 10"},
    {"Nan", "[input]\nrate_deg_h = nan",
     "s.toml:2:14: key \"input.rate_deg_h\" = nan: must be finite and between -1e7 and 1e7"},
    {"Infinity", "[input]\nrate_deg_h = -inf", "\"input.rate_deg_h\" = -inf: must be finite and between"},
    {"FloatForInteger", "[ensemble]\ngyros = 8.0",
     "s.toml:2:9: key \"ensemble.gyros\" = 8.0: must be a whole number between 1 and 10000000, not a float"},
    {"StringForNumber", "[gyro]\nscale_factor_arcsec = \"0.5\"",
     "s.toml:2:23: key \"gyro.scale_factor_arcsec\" = \"0.5\": must be a number between 0.001 and 1000, not a string"},
    {"BooleanForNumber", "[gyro]\nscale_factor_arcsec = true",
     "= true: must be a number between 0.001 and 1000, not a "
     "boolean"},
    {"ListForNumber", "[gyro]\nscale_factor_arcsec = [0.5]", "= a list: must be a number between"},
    {"TableForNumber", "[gyro.scale_factor_arcsec]\nx = 1", "= a table: must be a number between"},
    {"DateForNumber", "[gyro]\nscale_factor_arcsec = 2020-01-01", "= a date or time: must be a number between"},
    {"NumberForBoolean", "[output]\nangle_record = 1",
     "s.toml:2:16: key \"output.angle_record\" = 1: must be true or false, not a whole number"},
    {"NumberForWord", "[readout]\nmodel = 3",
     "\"readout.model\" = 3: must be one of \"ideal\", \"latched\", \"instrument\", not a "
     "whole number"},
    {"UnknownWord", "[readout]\nmodel = \"instrumnt\"",
     "s.toml:2:9: key \"readout.model\" = \"instrumnt\": must be one of \"ideal\", \"latched\", \"instrument\" (did "
     "you mean "
     "\"instrument\"?)"},
    {"MistypedKey", "[ensemble]\ngyors = 3",
     "s.toml:2:1: key \"ensemble.gyors\" = 3: unknown key (did you mean \"gyros\"?); keys of [ensemble]: gyros, "},
    {"KeyWithoutItsUnit", "[gyro]\nlockin_threshold = 3", "(did you mean \"lockin_threshold_deg_h\"?)"},
    {"KeyOfAnotherSection", "[ensemble]\npeak_rate_deg_s = 3",
     "\"ensemble.peak_rate_deg_s\" = 3: unknown key (\"peak_rate_deg_s\" belongs to [dither])"},
    {"KeyLikeNoOther", "[gyro]\nxyzzy = 3", "\"gyro.xyzzy\" = 3: unknown key; keys of [gyro]: scale_factor_arcsec, "},
    {"KeyOutsideOfSections", "gyros = 3",
     "s.toml:1:1: key \"gyros\" = 3: unknown key outside of any section (\"gyros\" "
     "belongs to [ensemble])"},
    {"DottedUnknownKey", "gyro.lockin = 3",
     "s.toml:1:6: key \"gyro.lockin\" = 3: unknown key (did you mean "
     "\"lockin_threshold_deg_h\"?)"},
    {"DotsWithinQuotes", "\"gyro.lockin_threshold_deg_h\" = 3", "(write gyro.lockin_threshold_deg_h without quotes)"},
    {"UnknownSection", "\n[ensembel]\ngyros = 1",
     "s.toml:2:2: section [ensembel]: unknown section (did you mean \"ensemble\"?); sections are: gyro, dither, "},
    {"ValueForSection", "gyro = 3", "s.toml:1:1: key \"gyro\" = 3: must be a table, not a whole number; write [gyro]"},
    {"ListOfTablesForSection", "[[gyro]]\n", "key \"gyro\" = a list: must be a table, not a list"},
    {"ListForArmsSection", "arms = [\"ideal\"]", "key \"arms\" = a list: must be a table"},
    {"ValueForEffects", "effects = 3", "s.toml:1:1: key \"effects\" = 3: must be tables [effects.NAME]"},
    {"ValueForEffect", "[effects]\nquantum_noise = 1e-4",
     "key \"effects.quantum_noise\" = 0.0001: must be a table, not a float; write [effects.quantum_noise]"},
    {"UnknownEffect", "[effects.quantum_nose]",
     "s.toml:1:10: section [effects.quantum_nose]: unknown effect (did you mean \"quantum_noise\"?); effects are: "},
    {"UnknownParameter", "[effects.bias_step]\nstep = 1",
     "key \"effects.bias_step.step\" = 1: unknown key (did you mean \"step_deg_h\"?); keys of [effects.bias_step]: "},
    {"EmptyArms", "[arms]\nnames = []",
     "s.toml:2:9: key \"arms.names\" = a list: is empty; must be a list of different "
     "arms of \"ideal\", \"uncompensated\", "},
    {"OneArmWithoutList", "[arms]\nnames = \"ideal\"",
     "key \"arms.names\" = \"ideal\": must be a list of different arms of"},
    {"ArmTwice", "[arms]\nnames = [\"ideal\", \"ideal\"]",
     "s.toml:2:19: key \"arms.names\" = \"ideal\": is given twice"},
    {"ArmThatIsANumber", "[arms]\nnames = [1]", "s.toml:2:10: key \"arms.names\" = 1: must be the name of an arm"},
    {"UnknownArm", "[arms]\nnames = [\"idael\"]",
     "s.toml:2:10: key \"arms.names\" = \"idael\": arm \"idael\": unknown arm (did you mean \"ideal\"?); arms are: "
     "ideal, "},
    {"DuplicateKey", "[ensemble]\ngyros = 1\ngyros = 2", "s.toml:3:"},
    {"DuplicateSection", "[gyro]\n[gyro]\n", "s.toml:2:"},
    {"SyntaxError", "[gyro\n", "s.toml:1:6: not valid TOML: "},
    {"MissingValue", "[gyro]\nscale_factor_arcsec =\n", "s.toml:2:22: not valid TOML: "},
    {"IntegerTooLarge", "[ensemble]\nseed = 9223372036854775808", "s.toml:2:"},
    {"NotText", "\x89HDF\r\n\x1a\n", "s.toml:1:"},
    {"ControlCharacterInKey", "\"a\\u001b[31m\" = 1", "key \"\"a\\x1b[31m\"\" = 1: unknown key"},
};

INSTANTIATE_TEST_SUITE_P(All, BadScenario, testing::ValuesIn(bad_cases),
                         [](const auto& bad) { return std::string(bad.param.title); });

TEST(ScenarioText, KeysOfEndlessPartsAreRefusedBeforeTheyOverflowTheStack) {
    std::string parts;
    for (int i = 0; i < 300000; ++i) parts += "a.";
    EXPECT_THAT(complaint(parts + "b = 1"), StartsWith("s.toml:1:66: a key of more than 32 parts"));
    EXPECT_THAT(complaint("[" + parts + "b]"), StartsWith("s.toml:1:67: a key of more than 32 parts"));
    EXPECT_THAT(complaint("\nx = " + std::string(100000, '[')), StartsWith("s.toml:2:"));
    EXPECT_EQ(complaint("# " + parts + "\n# " + std::string(200, '.') + "\n"), "");
}

TEST(ScenarioText, ReportsEveryProblemInTheOrderOfTheFile) {
    EXPECT_EQ(
        complaint("[ensemble]\nseed = -1\ngyros = 0\n[nowhere]\n[dither]\nfrequency_hz = \"x\"\n"),
        "s.toml:2:8: key \"ensemble.seed\" = -1: must be between 0 and 9223372036854775807 (integers of TOML are "
        "signed)\n"
        "s.toml:3:9: key \"ensemble.gyros\" = 0: must be between 1 and 10000000 (a study needs a gyro, and each one's "
        "results are kept)\n"
        "s.toml:4:2: section [nowhere]: unknown section; sections are: gyro, dither, noise_injection, readout, "
        "calibration, input, environment, ensemble, propagation, output, specification, record, reader, arms, design, "
        "stop, "
        "effects\n"
        "s.toml:6:16: key \"dither.frequency_hz\" = \"x\": must be a number between 1 and 100000, not a string");
}

/// A directory of its own, removed at the end.
class ScenarioFile : public testing::Test {
   protected:
    ScenarioFile() : dir_(std::filesystem::temp_directory_path() / ("ringlock_scenario_" + std::to_string(getpid()))) {
        std::filesystem::create_directories(dir_);
    }
    ~ScenarioFile() override { std::filesystem::remove_all(dir_); }
    std::filesystem::path dir_;
};

TEST_F(ScenarioFile, IsReadAndNamedInErrors) {
    const auto path = dir_ / "a.toml";
    std::ofstream(path) << "[ensemble]\ngyros = 3\n";
    EXPECT_EQ(parse_file(path).ensemble.gyros, 3);
    std::ofstream(path) << "[ensemble]\ngyros = 0\n";
    EXPECT_THAT(file_complaint(path), StartsWith(path.string() + ":2:9: key \"ensemble.gyros\" = 0"));
}

TEST_F(ScenarioFile, MissingOnesAndDirectoriesAreErrors) {
    EXPECT_THAT(file_complaint(dir_ / "none.toml"),
                AllOf(StartsWith((dir_ / "none.toml").string()), HasSubstr("No such file or directory")));
    EXPECT_THAT(file_complaint(dir_), HasSubstr("is a directory; a scenario is a TOML file"));
}

TEST_F(ScenarioFile, OversizedOnesAreRefusedBeforeTheyAreParsed) {
    const auto path = dir_ / "big.toml";
    std::ofstream(path) << "# " << std::string(17 << 20, 'x');
    EXPECT_THAT(file_complaint(path), HasSubstr("is larger than 16 MiB: not a scenario"));
    {
        std::ofstream keys(path);
        for (int i = 0; i < 30000; ++i) keys << "key_" << i << " = 1\n";
    }
    EXPECT_THAT(file_complaint(path), StartsWith(path.string() + ":20001:11: more than 20000 keys and sections"));
    {
        std::ofstream sections(path);
        for (int i = 0; i < 30000; ++i) sections << "[s" << i << "]\n";
    }
    EXPECT_THAT(file_complaint(path), StartsWith(path.string() + ":20001:1: more than 20000 keys and sections"));
    {
        std::ofstream values(path);
        values << "x = [";
        for (int i = 0; i < 600000; ++i) values << "1,";
    }
    EXPECT_THAT(file_complaint(path), HasSubstr(": more than 500000 values: not a scenario"));
}

}  // namespace
}  // namespace scenario_errors_test
}  // namespace ringlock::scenario
