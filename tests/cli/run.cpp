#include <gmock/gmock.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "engine/store/hdf5.hpp"
#include "tests/cli/program.hpp"
#include "tests/cli/result_data.hpp"

namespace ringlock {
namespace run_test {
namespace {

using nlohmann::json;
using test::data;
using test::Outcome;
using test::same_bits;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

/// Four gyros for some seconds in all ways of sharing a trajectory.
constexpr const char* small_scenario = R"([ensemble]
gyros = 4
duration_s = 50.0
[arms]
names = ["ideal", "uncompensated", "noise_injected", "noise_injected+compensated"]
)";

class RunCommand : public test::ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        write("s.toml", small_scenario);
    }
    /// Bad input: status 2, nothing on standard output, no file left.
    void expect_refused(const Arguments& arguments, const testing::Matcher<std::string>& message) const {
        const auto before = left();
        const Outcome r = run(arguments);
        const std::string shown = arguments.size() > 1 ? arguments[0] + " " + arguments[1] : "";
        EXPECT_EQ(r.status, 2) << shown << "\n" << r.err;
        EXPECT_EQ(r.out, "") << shown;
        EXPECT_THAT(r.err, AllOf(StartsWith("ringlock: error: "), message)) << shown;
        EXPECT_EQ(left(), before) << shown;
    }
    void expect_scenario_refused(const std::string& text, const testing::Matcher<std::string>& message) const {
        SCOPED_TRACE(text);
        write("bad.toml", text);
        expect_refused({"run", "bad.toml", "-o", "out.h5"}, message);
        expect_refused({"validate", "bad.toml"}, message);
    }
};

TEST_F(RunCommand, BadScenariosAreRefusedWithPlaceKeyValueAndWhatIsAllowed) {
    const auto says = [](auto... parts) { return AllOf(HasSubstr(parts)...); };
    expect_scenario_refused("[gyro]\nlockin_treshold_deg_h = 300.0\n",
                            says("bad.toml:2:1", "gyro.lockin_treshold_deg_h", "300.0", "lockin_threshold_deg_h"));
    expect_scenario_refused("\n[giro]\nscale_factor_arcsec = 1.0\n", says("bad.toml:2:", "giro", "gyro"));
    expect_scenario_refused("[ensemble]\ngyros = \"many\"\n",
                            says("bad.toml:2:9", "ensemble.gyros", "\"many\"", "a whole number between 1 and"));
    expect_scenario_refused("[ensemble]\ngyros = 1.5\n", says("bad.toml:2:9", "ensemble.gyros", "1.5", "whole number"));
    expect_scenario_refused("[ensemble]\n  gyros = 0\n", says("bad.toml:2:11", "ensemble.gyros", "0", "between 1 and"));
    expect_scenario_refused("[ensemble]\ngyros = -3\n", says("bad.toml:2:9", "-3", "between 1 and"));
    expect_scenario_refused("[ensemble]\ngyros = 99999999999999999999\n", says("bad.toml:2:"));
    expect_scenario_refused("[gyro]\nscale_factor_arcsec = nan\n",
                            says("bad.toml:2:23", "gyro.scale_factor_arcsec", "nan", "finite"));
    expect_scenario_refused("[gyro]\nscale_factor_arcsec = inf\n", says("bad.toml:2:23", "inf", "finite"));
    expect_scenario_refused("[gyro]\nscale_factor_arcsec = -inf\n", says("bad.toml:2:23", "-inf", "finite"));
    expect_scenario_refused("[gyro]\nscale_factor_arcsec = 0.0\n", says("bad.toml:2:23", "between 0.001 and 1000"));
    expect_scenario_refused("[gyro\n", says("bad.toml:1:", "not valid TOML"));
    expect_scenario_refused("[gyro]\na = 1\na = 2\n", says("bad.toml:3:", "not valid TOML"));
    expect_scenario_refused(std::string("\xff\xfe[gyro]\n"), says("bad.toml:1:", "not valid TOML"));
    expect_scenario_refused("[readout]\nmodel = \"perfect\"\n",
                            says("bad.toml:2:9", "readout.model", "perfect", "ideal", "instrument"));
    expect_scenario_refused("[output]\nangle_record = 1\n",
                            says("bad.toml:2:16", "output.angle_record", "true or false"));
    expect_scenario_refused("[arms]\nnames = [\"uncompensatd\"]\n",
                            says("bad.toml:2:10", "arms.names", "uncompensatd", "did you mean \"uncompensated\"?"));
    expect_scenario_refused("[arms]\nnames = [\"compensated_adaptive\"]\n",
                            says("bad.toml:2:9", "compensated_adaptive", "readout.model = \"instrument\""));
    expect_scenario_refused(
        "[dither]\npeak_rate_deg_s = 20\n[ensemble]\nduration_s = 3000\n"
        "[effects.bias_temperature]\ndeg_h_per_k = 100\n"
        "[environment]\ntemperature_ramp_k_per_h = 1000\n",
        says("bad.toml:6:15", "effects.bias_temperature.deg_h_per_k", "100.0", "too few fringes"));
    expect_scenario_refused(
        "[dither]\npeak_rate_deg_s = 0.8\n[gyro]\nlockin_threshold_deg_h = 20\n[input]\nprofile_time_s = [0, 600]\n"
        "profile_rate_deg_h = [0, 1400]\n",
        says("bad.toml:7:22", "input.profile_rate_deg_h", "1400.0", "too few fringes"));
    expect_scenario_refused("[arms]\nnames = []\n", says("bad.toml:2:9", "arms.names", "empty"));
    expect_scenario_refused("[arms]\nnames = [\"ideal\", \"ideal\"]\n", says("bad.toml:2:19", "given twice"));
    expect_scenario_refused("[effects.gremlins]\nnumber = 3\n", says("bad.toml:1:", "gremlins", "unknown effect"));
    expect_scenario_refused("[input]\nrate_deg_h = 250000.0\n",
                            says("bad.toml:2:14", "input.rate_deg_h", "250000", "must stay below", "deg/h"));
    expect_scenario_refused("[ensemble]\nduration_s = 1.0\n", says("bad.toml:2:14", "ensemble.duration_s", "samples"));
}

TEST_F(RunCommand, AllProblemsOfAFileAreToldAtOnce) {
    expect_scenario_refused("[ensemble]\ngyros = 0\nseed = -1\n[gyro]\nfoo = 1\n",
                            AllOf(HasSubstr("bad.toml:2:9"), HasSubstr("bad.toml:3:8"), HasSubstr("bad.toml:5:1")));
}

TEST_F(RunCommand, FilesThatAreNoScenarioAreRefused) {
    expect_refused({"run", "missing.toml"}, AllOf(HasSubstr("missing.toml"), HasSubstr("No such file")));
    expect_refused({"run", "."}, HasSubstr("is a directory"));
    expect_refused({"validate", "missing.toml"}, HasSubstr("missing.toml"));
    expect_refused({"validate", "missing.h5"}, HasSubstr("missing.h5"));
    expect_refused({"analyze", "missing.h5"}, HasSubstr("missing.h5"));
    write("text.h5", "this is text\n");
    expect_refused({"analyze", "text.h5"}, AllOf(HasSubstr("text.h5"), HasSubstr("HDF5")));
    expect_refused({"validate", "text.h5"}, AllOf(HasSubstr("text.h5"), HasSubstr("HDF5")));
    expect_refused({"validate", "s.txt"}, HasSubstr("s.txt"));
    store::File::create(directory_ / "other.h5").set_attribute("format", "something");
    expect_refused({"analyze", "other.h5"}, AllOf(HasSubstr("other.h5"), HasSubstr("not a ringlock result")));
}

TEST_F(RunCommand, AnEmptyScenarioIsValid) {
    write("empty.toml", "");
    const Outcome r = run({"validate", "empty.toml"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_EQ(r.out, "empty.toml: a valid scenario\n");
}

TEST_F(RunCommand, OutputsThatCannotBeWrittenAreRefusedBeforeTheRun) {
    expect_refused({"run", "s.toml", "-o", "missing/out.h5"}, AllOf(HasSubstr("missing/out.h5"), HasSubstr("No such")));
    expect_refused({"run", "s.toml", "-o", ""}, HasSubstr("the name of the output file is empty"));
    expect_refused({"run", "s.toml", "-o", std::string(300, 'x')}, HasSubstr("File name too long"));
    expect_refused({"run", "s.toml", "-o", "/dev/null"}, HasSubstr("not a regular file"));
    expect_refused({"run", "s.toml", "-o", "out.h5", "--plot", "missing/out.svg"}, HasSubstr("missing/out.svg"));
    expect_refused({"run", "s.toml", "-o", "out.h5", "--plot", "figure.gif"}, HasSubstr("must end in .svg"));
    expect_refused({"analyze", "out.h5", "--plot", "figure.gif"}, HasSubstr("must end in .svg"));
    EXPECT_EQ(read("s.toml"), small_scenario);
    if (geteuid() != 0) {
        std::filesystem::create_directory(directory_ / "closed");
        std::filesystem::permissions(directory_ / "closed", std::filesystem::perms::owner_read);
        expect_refused({"run", "s.toml", "-o", "closed/out.h5"}, HasSubstr("Permission denied"));
        std::filesystem::permissions(directory_ / "closed", std::filesystem::perms::owner_all);
    }
}

TEST_F(RunCommand, ForeignFilesAreKept) {
    write("other.toml", small_scenario);
    expect_refused({"run", "s.toml", "-o", "other.toml"}, AllOf(HasSubstr("other.toml"), HasSubstr("it is kept")));
    EXPECT_EQ(read("other.toml"), small_scenario);
    write("notes.h5", "notes\n");
    expect_refused({"run", "s.toml", "-o", "notes.h5"}, HasSubstr("it is kept"));
    EXPECT_EQ(read("notes.h5"), "notes\n");
    ASSERT_EQ(run({"run", "s.toml"}).status, 0);
    const std::string before = read("s.h5");
    expect_refused({"run", "s.toml", "--seed", "77"}, AllOf(HasSubstr("s.h5"), HasSubstr("it is kept")));
    EXPECT_EQ(read("s.h5"), before);
    EXPECT_EQ(run({"run", "s.toml"}).status, 0) << "the same scenario may run again";
}

TEST_F(RunCommand, SettingsOfTheCommandLineStandInPlaceOfTheFiles) {
    const Outcome r = run({"run", "s.toml", "--set", "ensemble.gyros=3", "--set", "specification.arw_deg_rt_h=0.1",
                           "--set", "output.tau_s=[5]", "--json", "-q"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("\"yield\""));
    EXPECT_THAT(r.out, HasSubstr("\"gyros\": 3"));
    EXPECT_THAT(r.out, HasSubstr("allan_deviation_5_s_deg_h"));
    const Outcome again = run({"analyze", "s.h5", "--json"});
    EXPECT_EQ(again.status, 0) << again.err;
    EXPECT_THAT(again.out, HasSubstr("allan_deviation_5_s_deg_h"));
    expect_refused({"run", "s.toml", "--set", "ensemble.gyros=0"}, HasSubstr("--set ensemble.gyros=0: "));
    expect_refused({"run", "s.toml", "--set", "gyros"}, HasSubstr("KEY=VALUE"));
    expect_refused({"validate", "s.h5", "--set", "ensemble.gyros=3"}, HasSubstr("not a scenario"));
    const Outcome valid = run({"validate", "s.toml", "--set", "device=triangle-51mm"});
    EXPECT_EQ(valid.status, 0) << valid.err;
}

TEST_F(RunCommand, WrongCommandLinesAreRefused) {
    expect_refused({"run", "s.toml", "--threads", "-1"}, AllOf(HasSubstr("--threads -1"), HasSubstr("between 1 and")));
    expect_refused({"run", "s.toml", "--threads", "100000"}, HasSubstr("between 1 and"));
    expect_refused({"run", "s.toml", "--threads", "two"}, HasSubstr("two"));
    expect_refused({"run", "s.toml", "--seed", "-1"}, AllOf(HasSubstr("--seed -1"), HasSubstr("between 0 and")));
    expect_refused({"run", "s.toml", "--seed", "1.5"}, HasSubstr("1.5"));
    expect_refused({"run", "s.toml", "--seed", "0x10"}, HasSubstr("0x10"));
    expect_refused({"run", "s.toml", "--seed", ""}, HasSubstr("--seed"));
    expect_refused({"run", "s.toml", "--seed", "99999999999999999999"}, HasSubstr("99999999999999999999"));
    expect_refused({"run", "s.toml", "--nonsense"}, HasSubstr("--nonsense"));
    expect_refused({"run", "s.toml", "s.toml"}, HasSubstr("s.toml"));
    expect_refused({"run"}, HasSubstr("scenario"));
    expect_refused({"run", "--print-schema=xml"}, AllOf(HasSubstr("xml"), HasSubstr("markdown")));
    expect_refused({}, HasSubstr("--help"));
    expect_refused({"rum", "s.toml"}, AllOf(HasSubstr("\"rum\""), HasSubstr("run, analyze, allan, validate")));
    expect_refused({"--nonsense"}, HasSubstr("--help"));
}

TEST_F(RunCommand, HelpListsTheCommands) {
    const Outcome help = run({"--help"});
    EXPECT_EQ(help.status, 0);
    for (const char* command :
         {"run", "merge", "status", "analyze", "allan", "validate", "closure", "replay", "report", "Exit status"}) {
        EXPECT_THAT(help.out, HasSubstr(command));
    }
    EXPECT_EQ(help.err, "");
    const Outcome of_run = run({"run", "--help"});
    EXPECT_EQ(of_run.status, 0);
    for (const char* option :
         {"--output", "--threads", "--seed", "--json", "--print-schema", "--resume", "--shard", "--checkpoint-every"}) {
        EXPECT_THAT(of_run.out, HasSubstr(option));
    }
    const Outcome version = run({"--version"});
    EXPECT_EQ(version.status, 0);
    EXPECT_THAT(version.out.substr(0, version.out.find('\n')),
                testing::MatchesRegex("ringlock [0-9]+\\.[0-9]+\\.[0-9]+ \\(.+\\)"));
}

TEST_F(RunCommand, PrintedSchemaIsAScenario) {
    const Outcome schema = run({"run", "--print-schema"});
    ASSERT_EQ(schema.status, 0) << schema.err;
    write("schema.toml", schema.out);
    EXPECT_EQ(run({"validate", "schema.toml"}).status, 0);
    EXPECT_EQ(run({"run", "--print-schema=toml"}).out, schema.out);
    EXPECT_EQ(run({"run", "--print-schema", "s.toml"}).out, schema.out) << "the next word is no form of the schema";
    EXPECT_EQ(run({"run", "s.toml", "--print-schema"}).out, schema.out);
    EXPECT_EQ(run({"run", "--print-schema=markdown"}).out, contents(RINGLOCK_SOURCE_DIR "/docs/scenario.md"));
    EXPECT_TRUE(json::parse(run({"run", "--print-schema=json"}).out).contains("sections"));
    EXPECT_EQ(left(), (std::set<std::string>{"s.toml", "schema.toml"}));
}

void expect_numbers(const json& object, std::initializer_list<const char*> names) {
    ASSERT_TRUE(object.is_object()) << object;
    for (const char* name : names) {
        ASSERT_TRUE(object.contains(name)) << name;
        EXPECT_TRUE(object[name].is_number()) << name << " = " << object[name];
    }
}

TEST_F(RunCommand, JsonIsOneObjectWithTheFieldsOfTheContract) {
    const Outcome r = run({"run", "s.toml", "-o", "out.h5", "--json", "--seed", "11"});
    ASSERT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.err, HasSubstr("out.h5"));
    const json out = json::parse(r.out);  // throws on anything before or after the one object
    EXPECT_EQ(out["scenario"], "s.toml");
    EXPECT_EQ(out["seed"], 11);
    expect_numbers(out, {"turns", "wall_s", "turns_per_s"});
    EXPECT_TRUE(out["turns"].is_number_integer());
    expect_numbers(out["theory"], {"arw_deg_rt_h", "dead_band_deg_h"});
    EXPECT_NEAR(out["theory"]["arw_deg_rt_h"], 0.0022490, 1e-7);
    EXPECT_NEAR(out["theory"]["arw_first_order_deg_rt_h"], 0.0022506, 1e-7);
    EXPECT_NEAR(out["theory"]["dead_band_deg_h"], 2.632, 1e-3);
    ASSERT_EQ(out["arms"].size(), 4U);
    for (const auto& [name, arm] : out["arms"].items()) {
        SCOPED_TRACE(name);
        EXPECT_EQ(arm["gyros"], 4);
        expect_numbers(arm["rate_error_deg_h"], {"mean", "lo", "hi"});
        EXPECT_LE(arm["rate_error_deg_h"]["lo"], arm["rate_error_deg_h"]["hi"]);
        ASSERT_TRUE(arm.contains("bias_instability_deg_h"));
        EXPECT_TRUE(arm["bias_instability_deg_h"].is_null()) << "no flicker was simulated";
        ASSERT_TRUE(arm.contains("arw_deg_rt_h"));
        const json& arw = arm["arw_deg_rt_h"];
        ASSERT_TRUE(arw.is_object()) << "quantum noise is declared by default";
        for (const char* key : {"median", "lo", "hi", "median_ci"}) EXPECT_TRUE(arw.contains(key)) << key;
        EXPECT_TRUE(arw["hi"].is_number()) << "an upper end or limit is always given";
        EXPECT_EQ(arw["median"].is_null(), arw["median_ci"].is_null());
        EXPECT_EQ(arw["median"].is_null(), arm["arw_reason"].is_string());
        expect_numbers(arm["theory"], {"arw_deg_rt_h", "lockin_arw_deg_rt_h"});
        EXPECT_TRUE(arm["theory"]["effects_arw_deg_rt_h"]["quantum_noise"].is_number());
        EXPECT_FALSE(arm.contains("yield")) << "nothing was specified";
        ASSERT_TRUE(arm["quantiles"]["rate_error_deg_h"].is_array());
        EXPECT_TRUE(arm["quantiles"]["rate_error_deg_h"][0]["lo"].is_null())
            << "four gyros do not bound the 5 % quantile";
    }
    EXPECT_EQ(left(), (std::set<std::string>{"out.h5", "s.toml"}));
}

TEST_F(RunCommand, SweepsShowTheClosedFormWhereTheDriveRepeatsItself) {
    const std::string sweep =
        "[input]\nrate_deg_h = 0.0\nsweep_stop_deg_h = 60.0\nsweep_points = 3\n"
        "[ensemble]\ngyros = 2\nduration_s = 20.0\ndither_amplitude_sd_relative = 0.0\n"
        "[arms]\nnames = [\"uncompensated\", \"noise_injected\"]\n";
    write("noisy.toml", sweep + "[effects.quantum_noise]\ndeg_rt_h = 1e-4\n");
    write("still.toml", sweep + "[effects.quantum_noise]\ndeg_rt_h = 0.0\n");
    const json noisy = json::parse(run({"run", "noisy.toml", "--json"}).out)["arms"]["uncompensated"];
    EXPECT_FALSE(noisy.contains("steps"));
    for (const json& rate : noisy["sweep"]) EXPECT_FALSE(rate.contains("closed_form_rate_deg_h"));
    EXPECT_THAT(run({"analyze", "noisy.h5"}).out, testing::Not(HasSubstr("closed form")));

    const Outcome r = run({"run", "still.toml", "--json", "--plot", "still.svg"});
    ASSERT_EQ(r.status, 0) << r.err;
    const json out = json::parse(r.out);
    const json& arms = out["arms"];
    const double interval_s = out["sample_interval_s"];
    const double fringe_deg_h = 0.5 / (std::floor(20.0 / interval_s) * interval_s);
    ASSERT_EQ(arms["uncompensated"]["sweep"].size(), 3U);
    for (const json& rate : arms["uncompensated"]["sweep"]) {
        expect_numbers(rate, {"input_rate_deg_h", "closed_form_rate_deg_h"});
        // A fringe over the record; the instrument's reading noise, 0.005 rad, is small against it.
        EXPECT_NEAR(rate["closed_form_rate_deg_h"], rate["output_rate_deg_h"]["mean"], 1.01 * fringe_deg_h);
    }
    ASSERT_EQ(arms["uncompensated"]["steps"].size(), 1U) << "locked at 0 deg/h, free at 30 and 60";
    const json& step = arms["uncompensated"]["steps"][0];
    expect_numbers(step, {"order", "output_rate_deg_h", "first_input_rate_deg_h", "last_input_rate_deg_h"});
    EXPECT_EQ(step["order"], 0);
    EXPECT_FALSE(arms["noise_injected"].contains("steps"));
    for (const json& rate : arms["noise_injected"]["sweep"]) EXPECT_FALSE(rate.contains("closed_form_rate_deg_h"));
    EXPECT_EQ(json::parse(run({"analyze", "still.h5", "--json"}).out)["arms"], arms);
    EXPECT_THAT(run({"analyze", "still.h5"}).out, AllOf(HasSubstr("closed form"), HasSubstr("step n")));
    EXPECT_THAT(read("still.svg"), HasSubstr("uncompensated, closed form"));
}

TEST_F(RunCommand, SweepsOfThreeRatesShowTheLineThroughThem) {
    const char* const fields[] = {
        "scale_factor_error_ppm", "scale_factor_repeatability_ppm", "bias_deg_h",   "largest_deviation_deg_h",
        "nonlinearity_ppm",       "gyro_deviation_deg_h",           "scatter_deg_h"};
    const auto sweep = [](int points) {
        return "[input]\nrate_deg_h = 0.0\nsweep_stop_deg_h = 60.0\nsweep_points = " + std::to_string(points) +
               "\n[ensemble]\ngyros = 3\nduration_s = 60.0\n"
               "[arms]\nnames = [\"uncompensated\", \"noise_injected\", \"noise_injected+compensated\"]\n";
    };
    write("two.toml", sweep(2));
    const json of_two = json::parse(run({"run", "two.toml", "--json"}).out)["arms"];
    ASSERT_FALSE(of_two.empty());
    for (const auto& [name, arm] : of_two.items()) {
        for (const char* field : fields) EXPECT_TRUE(arm.contains(field) && arm[field].is_null()) << name << field;
    }
    EXPECT_THAT(run({"analyze", "two.h5"}).out, testing::Not(HasSubstr("Straight lines")));

    write("three.toml", sweep(3));
    const json arms = json::parse(run({"run", "three.toml", "--json"}).out)["arms"];
    for (const auto& [name, arm] : arms.items()) {
        SCOPED_TRACE(name);
        for (const char* field : fields) ASSERT_TRUE(arm.contains(field)) << field;
        for (const char* field : {"scale_factor_error_ppm", "bias_deg_h"}) {
            expect_numbers(arm[field], {"lo", "hi"});
            const bool holds_zero = arm[field]["lo"] <= 0.0 && arm[field]["hi"] >= 0.0;
            EXPECT_EQ(arm[field]["mean"].is_null(), holds_zero) << field;
        }
        expect_numbers(arm["bias_deg_h"], {"sd"});
        expect_numbers(arm["scale_factor_repeatability_ppm"], {"value", "lo", "hi", "noise"});
        expect_numbers(arm["scale_factor_repeatability_ppm"]["beyond_noise"], {"lo", "hi"});
        expect_numbers(arm["largest_deviation_deg_h"], {"lo", "hi", "input_rate_deg_h"});
        expect_numbers(arm["nonlinearity_ppm"], {"lo", "hi"});
        expect_numbers(arm["gyro_deviation_deg_h"], {"median", "lo", "hi"});
        EXPECT_TRUE(arm["scatter_deg_h"].is_number());
        // Parts per million of a full scale of 60 deg/h.
        EXPECT_NEAR(arm["nonlinearity_ppm"]["hi"], arm["largest_deviation_deg_h"]["hi"].get<double>() / 60e-6, 1e-6);
    }
    EXPECT_TRUE(arms["uncompensated"]["arw_reduction"].is_null());
    EXPECT_TRUE(arms["noise_injected"]["arw_reduction"].is_null());
    expect_numbers(arms["noise_injected+compensated"]["arw_reduction"], {"lo"});
    EXPECT_EQ(json::parse(run({"analyze", "three.h5", "--json"}).out)["arms"], arms);
    const std::string table = run({"analyze", "three.h5"}).out;
    const auto printed_yield = [&](const Arguments& arguments) {
        return json::parse(run(arguments).out)["arms"]["noise_injected"]["yield"];
    };
    const json yield = printed_yield(
        {"run", "three.toml", "--json", "-o", "yield.h5", "--set", "specification.scale_factor_error_ppm=1e5"});
    EXPECT_EQ(yield["gyros"], 3) << "gyros, not records";
    EXPECT_EQ(yield["limits"]["scale_factor_error_ppm"]["most"], 1e5);
    expect_refused({"run", "two.toml", "-o", "no.h5", "--set", "specification.scale_factor_error_ppm=5"},
                   AllOf(HasSubstr("--set specification.scale_factor_error_ppm=5"), HasSubstr("sweep_points to 3")));
    for (const char* text :
         {"Straight lines through the rates, 3 gyros at each, full scale 60 deg/h", "repeatability [ppm]",
          "nonlinearity [ppm of full scale]", "random walk of noise_injected over that of"}) {
        EXPECT_THAT(table, HasSubstr(text));
    }
}

TEST_F(RunCommand, TurnsOfSharedTrajectoriesCountOnce) {
    const auto turns = [&](const std::string& arms) -> std::int64_t {
        write("t.toml", "[ensemble]\ngyros = 3\nduration_s = 10.0\n[arms]\nnames = [" + arms + "]\n");
        std::filesystem::remove(directory_ / "t.h5");
        return json::parse(run({"run", "t.toml", "--json"}).out)["turns"];
    };
    const std::int64_t one = turns("\"noise_injected\"");
    EXPECT_GT(one, 3 * 2 * 8 * 124);  // three gyros, two turns a cycle
    EXPECT_LE(one, 3 * (2 * 10 * 125 + 1));
    EXPECT_EQ(turns("\"noise_injected\", \"noise_injected+compensated\""), one);
    EXPECT_EQ(turns("\"uncompensated\", \"compensated\", \"compensated_published\""), one);
    EXPECT_EQ(turns("\"uncompensated\", \"noise_injected\", \"noise_injected+compensated\""), 2 * one);
}

TEST_F(RunCommand, TableComparesTheArms) {
    const Outcome r = run({"run", "s.toml", "--quiet"});
    ASSERT_EQ(r.status, 0);
    EXPECT_EQ(r.err, "");
    for (const char* text : {"ideal", "uncompensated", "noise_injected+compensated", "0.002249", "2.632", "4 gyros"}) {
        EXPECT_THAT(r.out, HasSubstr(text));
    }
    EXPECT_THAT(r.out, testing::Not(HasSubstr("nan")));
    EXPECT_THAT(r.out, testing::Not(HasSubstr("inf ")));
    EXPECT_EQ(left(), (std::set<std::string>{"s.h5", "s.toml"}));
}

TEST_F(RunCommand, AnalyzeSaysWhatRunSaid) {
    const Outcome r = run({"run", "s.toml", "-o", "out.h5", "--json"});
    const Outcome again = run({"analyze", "out.h5", "--json"});
    ASSERT_EQ(again.status, 0) << again.err;
    EXPECT_EQ(again.err, "");
    EXPECT_EQ(json::parse(again.out), json::parse(r.out));
    const Outcome table = run({"analyze", "out.h5"});
    EXPECT_THAT(table.out, HasSubstr("noise_injected+compensated"));
    const Outcome valid = run({"validate", "out.h5"});
    EXPECT_EQ(valid.status, 0);
    EXPECT_EQ(valid.out, "out.h5: a valid result of 4 gyros and 4 arms\n");
}

// The whole family of a result's arms, from its angle records.
TEST_F(RunCommand, AnalyzeTakesTheFamilyFromAngleRecords) {
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5"}).status, 0);
    const Outcome r = run({"analyze", "out.h5", "--json", "--dev", "oadev,mdev,htotdev,mtie"});
    ASSERT_EQ(r.status, 0) << r.err;
    const json found = json::parse(r.out);
    for (const auto& [name, arm] : found["arms"].items()) {
        ASSERT_EQ(arm["deviations"].size(), 4u) << name;
        ASSERT_FALSE(arm["deviations"]["mdev"].empty()) << name;
        for (const auto& point : arm["deviations"]["mdev"]) {
            EXPECT_LE(point["lo"], point["dev"]) << name;
            EXPECT_GE(point["hi"], point["dev"]) << name;
        }
        EXPECT_TRUE(arm["deviations"]["mtie"][0]["lo"].is_null()) << name;
    }
    EXPECT_THAT(run({"analyze", "out.h5", "--dev", "tdev"}).out, HasSubstr("tdev [arcsec]"));
    expect_refused({"analyze", "out.h5", "--dev", "pdev"}, HasSubstr("'pdev' is not known"));
}

// Four gyros whose samples are not a whole number of seconds apart.
TEST_F(RunCommand, AnalyzeTakesDeviationsAtTimesAskedForFromAngleRecords) {
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5", "--set", "dither.frequency_hz=401.3"}).status, 0);
    // Factors and times may be mixed; what is asked for twice is told once.
    const Outcome r = run({"analyze", "out.h5", "--json", "--tau", "10s, 1,3,0.1min,1s,3"});
    ASSERT_EQ(r.status, 0) << r.err;
    const json found = json::parse(r.out);
    const double interval_s = found["sample_interval_s"];
    EXPECT_DOUBLE_EQ(interval_s, 401.0 / 401.3);
    for (const auto& [name, arm] : found["arms"].items()) {
        ASSERT_EQ(arm["asked"].size(), 4U) << name;
        std::map<std::int64_t, double> variance;
        for (int gyro = 0; gyro < 4; ++gyro) {
            const std::string column = "/arms/" + name + "/angle_arcsec[" + std::to_string(gyro) + ",:]";
            const Outcome one = run({"allan", "out.h5", "--column", column, "--kind", "phase", "--unit", "arcsec",
                                     "--rate", "1.00074812967581", "--tau", "1,3,6,10", "--json"});
            ASSERT_EQ(one.status, 0) << one.err;
            const json points = json::parse(one.out)["deviations"]["oadev"];
            ASSERT_FALSE(points.empty());
            for (const json& point : points) {
                variance[point["m"]] += std::pow(point["dev"].get<double>(), 2) / 4.0;
            }
        }
        auto point = arm["asked"].begin();
        for (const auto& [m, mean] : variance) {
            SCOPED_TRACE(name + " " + std::to_string(m));
            EXPECT_DOUBLE_EQ((*point)["tau_s"], static_cast<double>(m) * interval_s);
            EXPECT_NEAR((*point)["dev_deg_h"].get<double>() / std::sqrt(mean), 1.0, 1e-12) << "rounding of --rate";
            EXPECT_LT((*point)["lo"], (*point)["dev_deg_h"]);
            EXPECT_GT((*point)["hi"], (*point)["dev_deg_h"]);
            EXPECT_GT((*point)["edf"], 4.0);
            ++point;
        }
    }
    EXPECT_FALSE(json::parse(run({"analyze", "out.h5", "--json"}).out)["arms"]["ideal"].contains("asked"));
}

TEST_F(RunCommand, AnalyzeSaysWhichTimesAreNoWholeNumberOfSamples) {
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5", "--set", "dither.frequency_hz=401.3"}).status, 0);
    const Outcome r = run({"analyze", "out.h5", "--tau", "10s,1,25s"});
    ASSERT_EQ(r.status, 0) << r.err;
    const std::size_t begin = r.out.find("Allan deviation [deg/h] at the averaging times asked for");
    ASSERT_NE(begin, std::string::npos) << r.out;
    const std::string table = r.out.substr(begin);
    EXPECT_THAT(table, AllOf(HasSubstr("from stored samples of 0.999252 s;\n68.27 % intervals\n"),
                             HasSubstr("noise_injected+compensated   9.99252")));
    EXPECT_THAT(table, testing::EndsWith("\nasked 10 s, nearest whole number of samples: 9.99252 s\n"
                                         "asked 25 s, nearest whole number of samples: 24.9813 s\n"));
    std::istringstream lines(r.out);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100U) << line;
    // Samples of a second, to the digits shown: nothing to say.
    ASSERT_EQ(run({"run", "s.toml", "-o", "whole.h5", "--set", "dither.frequency_hz=400"}).status, 0);
    EXPECT_THAT(run({"analyze", "whole.h5", "--tau", "10s,25s"}).out, Not(HasSubstr("nearest whole number")));
}

TEST_F(RunCommand, AveragingTimesThatAreNotThereAreRefused) {
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5", "--set", "dither.frequency_hz=401.3"}).status, 0);
    const auto refused = [&](const std::string& list, auto... parts) {
        SCOPED_TRACE(list);
        expect_refused({"analyze", "out.h5", "--tau", list}, AllOf(HasSubstr("--tau"), HasSubstr(parts)...));
    };
    const char* const range = "from 0.999252 s (one sample) to 24.9813 s (25 samples)";
    refused("10s,0.9s", "0.9s", "shorter than a stored sample", range, "output.tau_s");
    refused("5ms", "5ms", "shorter than a stored sample", range);
    refused("25.1s", "25.1s", "longer than half of the record", range, "ensemble.duration_s");
    refused("1e300h", "longer than half of the record");
    refused("26", "--tau 26", "half of the record", range, "unit s");
    refused("", "empty", "100s");
    refused(" ", "empty");
    for (const char* wrong : {"10s,", ",", "0", "-3", "0s", "-1s", "1.5", "10 s", "5us", "s", "ten", "nans", "infs",
                              "1e400s", "0x10", "10S", "10s;20s", "99999999999999999999"}) {
        refused(wrong, "must be times with a unit (100s, 2min, 1h) or averaging factors");
    }
    std::string many = "1s";
    for (int i = 1; i < 100; ++i) many += ",1s";
    EXPECT_EQ(run({"analyze", "out.h5", "--tau", many}).status, 0);
    refused(many + ",1s", "101 averaging times; at most 100");
    ASSERT_EQ(run({"run", "s.toml", "-o", "bare.h5", "--set", "output.angle_record=false"}).status, 0);
    expect_refused({"analyze", "bare.h5", "--tau", "10s,0.5s"},
                   AllOf(HasSubstr("bare.h5"), HasSubstr("not stored"), HasSubstr("output.tau_s = [10, 0.5]"),
                         HasSubstr("output.angle_record = true")));
}

TEST_F(RunCommand, DamagedResultsAreRefusedByName) {
    ASSERT_EQ(run({"run", "s.toml", "-o", "out.h5"}).status, 0);
    const std::string whole = read("out.h5");
    write("out.h5", whole.substr(0, whole.size() / 2));
    expect_refused({"analyze", "out.h5"}, HasSubstr("out.h5"));
    expect_refused({"validate", "out.h5"}, HasSubstr("out.h5"));
    expect_refused({"run", "s.toml", "-o", "out.h5"}, HasSubstr("it is kept"));
}

TEST_F(RunCommand, DataAreTheSameToTheBitForAnyNumberOfThreads) {
    for (const char* threads : {"1", "2", "8"}) {
        const Outcome r = run({"run", "s.toml", "-o", std::string(threads) + ".h5", "--threads", threads});
        ASSERT_EQ(r.status, 0) << r.err;
    }
    const auto one = data(directory_ / "1.h5");
    EXPECT_GT(one.size(), 100U);
    for (const char* other : {"2.h5", "8.h5"}) {
        const auto found = data(directory_ / other);
        ASSERT_EQ(found.size(), one.size());
        for (const auto& [name, values] : one) EXPECT_TRUE(same_bits(values, found.at(name))) << other << name;
    }
    ASSERT_EQ(run({"run", "s.toml", "-o", "seed.h5", "--seed", "2"}).status, 0);
    const auto seed = data(directory_ / "seed.h5");
    for (const char* name : {"/gyros/initial_phase_rad", "/arms/noise_injected/angle_arcsec",
                             "/arms/noise_injected+compensated/rate_error_deg_h"}) {
        EXPECT_FALSE(same_bits(one.at(name), seed.at(name))) << name;
    }

    if (!has_h5diff()) GTEST_SKIP() << "h5diff is not there (hdf5-tools)";
    EXPECT_TRUE(same_results("1.h5", "2.h5"));
    EXPECT_TRUE(same_results("1.h5", "8.h5"));
    EXPECT_FALSE(same_results("1.h5", "seed.h5"));
}

}  // namespace
}  // namespace run_test
}  // namespace ringlock
