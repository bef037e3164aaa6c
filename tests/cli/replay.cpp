// Gyros of a result replayed from the command line, held against the result as its file has it.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "engine/scenario/arm.hpp"
#include "engine/store/hdf5.hpp"
#include "tests/cli/program.hpp"
#include "tests/cli/result_data.hpp"
#include "tests/support/open_file.hpp"

namespace ringlock {
namespace replay_test {
namespace {

using nlohmann::json;
using test::Outcome;
using test::same_bits;
using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

/// Some seconds of a few gyros, ten samples a second, after a time to settle.
constexpr const char* few_of_any = R"([ensemble]
gyros = 4
duration_s = 3.0
settle_s = 0.5
lockin_threshold_sd_relative = 0.05
[output]
sample_interval_s = 0.1
)";
/// The same with 40 cycles of the dither in a sample.
const std::string few = std::string("[dither]\nfrequency_hz = 400\n") + few_of_any;
const std::string instrument = "[readout]\nmodel = \"instrument\"\n";

class ReplayCommand : public test::ProgramTest {
   protected:
    void simulate(const std::string& name, const std::string& text) const {
        write(name + ".toml", text);
        const Outcome r = run({"run", name + ".toml", "-q"});
        ASSERT_EQ(r.status, 0) << r.err << text;
    }
    /// A replay that succeeds: what --json says of it.
    json replayed(Arguments arguments) const {
        arguments.insert(arguments.begin(), "replay");
        arguments.insert(arguments.end(), {"--json", "-q"});
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 0) << r.err;
        EXPECT_EQ(r.err, "");
        return r.status == 0 ? json::parse(r.out) : json();
    }
    store::File open(const std::string& name) const { return test::open_file(directory_ / name); }

    /// Samples among the turns of a replay, by its attributes alone.
    std::vector<double> decimated(const std::string& replay) const {
        const store::File file = open(replay);
        const std::int64_t first = file.int_attribute("first_turn");
        const std::int64_t every = file.int_attribute("turns_per_sample");
        const auto angles = file.dataset("turns/angle_arcsec").read<double>();
        std::vector<double> samples;
        for (std::size_t row = 0; row < angles.size(); ++row) {
            const std::int64_t number = first + static_cast<std::int64_t>(row);
            if (number >= 0 && number % every == 0) samples.push_back(angles[row]);
        }
        return samples;
    }
    std::vector<double> stored(const std::string& result, const std::string& arm, std::uint64_t row) const {
        return open(result).group("arms").group(arm).dataset("angle_arcsec").read_rows<double>(row, 1);
    }
    /// Replays a gyro and holds all its samples against a row of the result.
    json expect_stored(const std::string& result, const std::string& arm, std::uint64_t row,
                       Arguments more = {"--gyro", "0"}) const {
        std::filesystem::remove(directory_ / "r.h5");
        more.insert(more.begin(), {result, "--arm", arm, "-o", "r.h5"});
        const json told = replayed(more);
        if (told.is_null()) return told;
        const auto samples = stored(result, arm, row);
        EXPECT_TRUE(same_bits(decimated("r.h5"), samples)) << arm << " row " << row;
        EXPECT_EQ(told["samples_compared"], samples.size()) << arm;
        EXPECT_EQ(told["agrees"], (json{{"drawn", true}, {"rate_error", true}, {"record", true}})) << arm;
        return told;
    }
    /// Bad input: status 2, nothing on standard output, no file left.
    void expect_refused(Arguments arguments, const testing::Matcher<std::string>& message, int status = 2) const {
        arguments.insert(arguments.begin(), "replay");
        const auto before = left();
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, status) << r.err;
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, AllOf(HasSubstr("ringlock: error: "), message));
        EXPECT_EQ(left(), before);
    }
    /// Opens a file for a change by hand.
    template <class Change>
    void change(const std::string& name, Change how) const {
        const hid_t file = H5Fopen((directory_ / name).c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
        ASSERT_GE(file, 0);
        how(file);
        ASSERT_GE(H5Fclose(file), 0);
    }
    /// Moves one number of a dataset by its last digit.
    void nudge(const std::string& name, const std::string& dataset, std::vector<hsize_t> at) const {
        change(name, [&](hid_t file) {
            const hid_t data = H5Dopen2(file, dataset.c_str(), H5P_DEFAULT);
            ASSERT_GE(data, 0) << dataset;
            const hid_t space = H5Dget_space(data);
            const std::vector<hsize_t> one(at.size(), 1);
            H5Sselect_hyperslab(space, H5S_SELECT_SET, at.data(), nullptr, one.data(), nullptr);
            const hid_t memory = H5Screate_simple(static_cast<int>(one.size()), one.data(), nullptr);
            double value = 0.0;
            ASSERT_GE(H5Dread(data, H5T_NATIVE_DOUBLE, memory, space, H5P_DEFAULT, &value), 0);
            value = std::nextafter(value, 1e300);
            ASSERT_GE(H5Dwrite(data, H5T_NATIVE_DOUBLE, memory, space, H5P_DEFAULT, &value), 0);
            H5Sclose(memory);
            H5Sclose(space);
            H5Dclose(data);
        });
    }
};

std::string with_arms(const std::string& text, const std::vector<std::string>& arms) {
    std::string names;
    for (const std::string& arm : arms) names += (names.empty() ? "\"" : ", \"") + arm + "\"";
    return text + "[arms]\nnames = [" + names + "]\n";
}

class LongReplayCommand : public ReplayCommand {};

TEST_F(ReplayCommand, EveryArmIsItsStoredRecordToTheBit) {
    const auto arms = scenario::arm_names();
    ASSERT_GE(arms.size(), 15U);
    simulate("s", with_arms(few + instrument, arms));
    for (const std::string& arm : arms) {
        const json told = expect_stored("s.h5", arm, 2, {"--gyro", "2"});
        ASSERT_FALSE(told.is_null());
        const store::File file = open("r.h5");
        EXPECT_EQ(file.string_attribute("arm"), arm);
        EXPECT_EQ(file.int_attribute("gyro"), 2);
        const auto steps = file.dataset("truth/lockin_step_rad").read<double>();
        const auto corrections = file.dataset("turns/correction_rad").read<double>();
        EXPECT_TRUE(std::isnan(steps.front())) << "there is no turn before the first";
        const double largest = std::abs(*std::max_element(
            steps.begin() + 1, steps.end(), [](double a, double b) { return std::abs(a) < std::abs(b); }));
        if (arm == "ideal") {
            EXPECT_LT(largest, 1e-9) << "but for rounding";
        } else {
            EXPECT_GT(largest, 1e-2) << arm;
        }
        const bool corrected = arm.find("compensated") != std::string::npos && arm != "uncompensated";
        // The two trains have nothing to say before minutes are over.
        if (!arm.ends_with("two_train")) {
            EXPECT_EQ(std::ranges::any_of(corrections, [](double value) { return value != 0.0; }), corrected) << arm;
        }
        EXPECT_EQ(told["lockin_step_rms_rad"].get<double>() > 1e-4, arm != "ideal") << arm;
        if (arm.ends_with("compensated_exact")) {
            EXPECT_LT(told["left_step_rms_rad"].get<double>(), 0.3 * told["lockin_step_rms_rad"].get<double>());
        }
        if (arm == "uncompensated") {
            EXPECT_EQ(told["left_step_rms_rad"], told["lockin_step_rms_rad"]);
        }
    }
}

TEST_F(LongReplayCommand, EveryReadoutIsReplayed) {
    const std::vector<std::string> arms{"uncompensated", "compensated", "noise_injected+compensated_exact"};
    for (const char* readout :
         {"model = \"ideal\"\n", "model = \"latched\"\n", "model = \"latched\"\nangle_output = \"quarter_fringe\"\n",
          "model = \"instrument\"\nphase_from = \"detectors\"\nangle_output = \"quarter_fringe\"\n",
          "model = \"instrument\"\nellipse_correction = true\n[effects.readout_ellipse]\ngain = 0.05\n"
          "[effects.missed_counts]\nprobability_per_turn = 1e-3\n"}) {
        simulate("s", with_arms(few + "[readout]\n" + readout, arms));
        for (const std::string& arm : arms) expect_stored("s.h5", arm, 3, {"--gyro", "3"});
        std::filesystem::remove(directory_ / "s.h5");
    }
}

TEST_F(ReplayCommand, TheReadingsAreThoseOfTheTruth) {
    simulate("s", with_arms(few + "[readout]\nmodel = \"ideal\"\n", {"noise_injected+compensated_exact"}));
    expect_stored("s.h5", "noise_injected+compensated_exact", 0);
    const store::File file = open("r.h5");
    const auto numbers = [&](const std::string& name) { return file.dataset(name).read<double>(); };
    const auto whole = numbers("truth/phase_whole_fringes");
    const auto rest = numbers("truth/phase_rest_rad");
    ASSERT_GT(rest.size(), 2000U);
    EXPECT_EQ(numbers("readings/phase_whole_fringes"), whole);
    EXPECT_EQ(numbers("readings/phase_rest_rad"), rest);
    const auto sine = numbers("readings/sine"), cosine = numbers("hardware/cosine");
    for (std::size_t i = 0; i < rest.size(); ++i) {
        ASSERT_NEAR(sine[i], std::sin(rest[i]), 1e-8) << i;
        ASSERT_NEAR(cosine[i], std::cos(rest[i]), 1e-8) << i;
    }
    const auto count = numbers("hardware/quarter_count");
    for (std::size_t i = 0; i < rest.size(); ++i) {
        const double quarters = 4.0 * (whole[i] + rest[i] / 6.283185307179586);
        ASSERT_LE(count[i], quarters + 1e-6) << i;
        ASSERT_GE(count[i], quarters - 1.0 - 1e-6) << i;
    }
    EXPECT_EQ(numbers("hardware/zero_rate_s"), numbers("truth/zero_rate_s"));
    EXPECT_FALSE(file.has_dataset("readings/pulses_before_s"));
}

TEST_F(ReplayCommand, PointsOfADesignAreReplayed) {
    simulate("d", with_arms(few, {"uncompensated", "noise_injected+compensated"}) +
                      "[design]\nkind = \"list\"\n[[design.vary]]\nkey = \"gyro.lockin_threshold_deg_h\"\n"
                      "values = [100, 200, 300]\n[[design.vary]]\nkey = \"input.rate_deg_h\"\nvalues = [0, 5, -7]\n");
    for (int point = 1; point <= 3; ++point) {
        const json told = expect_stored("d.h5", "noise_injected+compensated", 4 * (point - 1) + 3,
                                        {"--point", std::to_string(point), "--gyro", "3"});
        EXPECT_EQ(told["point"], point);
        EXPECT_EQ(told["drawn"]["input_rate_deg_h"], point == 1 ? 0.0 : point == 2 ? 5.0 : -7.0);
        EXPECT_EQ(open("r.h5").int_attribute("point"), point);
    }
    EXPECT_EQ(replayed({"d.h5", "--arm", "uncompensated", "--gyro", "1", "--point", "2"})["replay"],
              "d-uncompensated-point-2-gyro-1.h5");
    EXPECT_TRUE(left().contains("d-uncompensated-point-2-gyro-1.h5"));
    expect_refused({"d.h5", "--arm", "uncompensated", "--gyro", "1"},
                   AllOf(HasSubstr("--point"), HasSubstr("points 1 to 3")));
    expect_refused({"d.h5", "--arm", "uncompensated", "--gyro", "1", "--point", "4"},
                   AllOf(HasSubstr("--point 4"), HasSubstr("points 1 to 3")));
    expect_refused({"d.h5", "--arm", "uncompensated", "--gyro", "1", "--point", "0"}, HasSubstr("points 1 to 3"));
    expect_refused({"d.h5", "--arm", "uncompensated", "--gyro", "4", "--point", "1"},
                   HasSubstr("gyros 0 to 3 at each point"));
}

TEST_F(ReplayCommand, GyrosOfASweepAreNumberedRateByRate) {
    simulate("s", with_arms(few + instrument, {"uncompensated", "compensated_adaptive"}) +
                      "[input]\nrate_deg_h = -10\nsweep_stop_deg_h = 20\nsweep_points = 4\n");
    for (const int gyro : {0, 3, 4, 15}) {
        const json told = expect_stored("s.h5", "compensated_adaptive", static_cast<std::uint64_t>(gyro),
                                        {"--gyro", std::to_string(gyro)});
        EXPECT_EQ(told["drawn"]["input_rate_deg_h"], -10.0 + 10.0 * (gyro / 4));
    }
    expect_refused({"s.h5", "--arm", "uncompensated", "--gyro", "16"},
                   AllOf(HasSubstr("gyros 0 to 15"), HasSubstr("4 at each of 4 rates")));
}

TEST_F(ReplayCommand, TurnOnsOfOneGyroAreReplayed) {
    std::string text = few;
    text.insert(text.find("settle_s"), "turn_ons = 2\n");
    simulate("s", with_arms(text, {"noise_injected+compensated_two_train"}));
    std::vector<json> drawn;
    for (int gyro = 0; gyro < 4; ++gyro) {
        drawn.push_back(expect_stored("s.h5", "noise_injected+compensated_two_train", static_cast<std::uint64_t>(gyro),
                                      {"--gyro", std::to_string(gyro)})["drawn"]);
    }
    EXPECT_EQ(drawn[0]["lockin_threshold_deg_h"], drawn[1]["lockin_threshold_deg_h"]);
    EXPECT_NE(drawn[0]["initial_phase_rad"], drawn[1]["initial_phase_rad"]);
    EXPECT_NE(drawn[1]["lockin_threshold_deg_h"], drawn[2]["lockin_threshold_deg_h"]);
}

TEST_F(ReplayCommand, ResultsWithoutRecordsAreHeldAgainstTheirRates) {
    simulate("s", with_arms(few + std::string("angle_record = false\n"), {"uncompensated", "compensated"}));
    const json told = replayed({"s.h5", "--arm", "compensated", "--gyro", "1", "-o", "r.h5"});
    EXPECT_EQ(told["agrees"], (json{{"drawn", true}, {"rate_error", true}, {"record", nullptr}}));
    EXPECT_EQ(told["samples_compared"], 0);
    const auto rates = open("s.h5").dataset("arms/compensated/rate_error_deg_h").read<double>();
    EXPECT_TRUE(same_bits({told["rate_error_deg_h"].get<double>()}, {rates[1]}));
    EXPECT_EQ(open("r.h5").int_attribute("samples_compared"), 0);
    const Outcome text = run({"replay", "s.h5", "--arm", "compensated", "--gyro", "1", "-o", "r.h5"});
    EXPECT_THAT(text.out, AllOf(HasSubstr("not stored (output.angle_record = false)"), HasSubstr("rate error")));
    nudge("s.h5", "arms/compensated/rate_error_deg_h", {1});
    expect_refused({"s.h5", "--arm", "compensated", "--gyro", "1", "-o", "r.h5"}, HasSubstr("rate_error_deg_h"), 1);
    replayed({"s.h5", "--arm", "compensated", "--gyro", "2", "-o", "other.h5"});
}

TEST_F(ReplayCommand, DevicesWithFewFringesAreReplayed) {
    for (const char* device : {"triangle-20mm", "triangle-51mm"}) {
        simulate("s", with_arms(std::string("device = \"") + device + "\"\n" + few_of_any + instrument,
                                {"uncompensated", "noise_injected+compensated_extrapolated"}));
        expect_stored("s.h5", "uncompensated", 1, {"--gyro", "1"});
        expect_stored("s.h5", "noise_injected+compensated_extrapolated", 1, {"--gyro", "1"});
        std::filesystem::remove(directory_ / "s.h5");
    }
}

TEST_F(ReplayCommand, GyrosOfALotThatGrewAreReplayed) {
    simulate("g",
             "[ensemble]\nduration_s = 10.0\n[arms]\nnames = [\"noise_injected\", \"noise_injected+compensated\"]\n"
             "[output]\nangle_record = false\n[stop]\narw_relative = 0.5\nmost_gyros = 64\n");
    const auto gyros = open("g.h5").dataset("stop/looks").read<std::int64_t>().back();
    const auto rates = open("g.h5").dataset("arms/noise_injected+compensated/rate_error_deg_h").read<double>();
    ASSERT_EQ(static_cast<std::int64_t>(rates.size()), gyros);
    for (const std::int64_t gyro : {std::int64_t{0}, gyros - 1}) {
        std::filesystem::remove(directory_ / "r.h5");
        const json told =
            replayed({"g.h5", "--arm", "noise_injected+compensated", "--gyro", std::to_string(gyro), "-o", "r.h5"});
        EXPECT_TRUE(same_bits({told["rate_error_deg_h"].get<double>()}, {rates[static_cast<std::size_t>(gyro)]}));
        EXPECT_EQ(told["agrees"]["rate_error"], true);
    }
    expect_refused({"g.h5", "--arm", "noise_injected", "--gyro", std::to_string(gyros)},
                   HasSubstr("gyros 0 to " + std::to_string(gyros - 1)));
}

TEST_F(ReplayCommand, PartsAreRowsOfTheWhole) {
    simulate("s", with_arms(few, {"uncompensated"}));
    const Arguments gyro{"s.h5", "--arm", "uncompensated", "--gyro", "1"};
    const auto with = [&](const Arguments& more) {
        Arguments all = gyro;
        all.insert(all.end(), more.begin(), more.end());
        return all;
    };
    const json whole = replayed(with({"-o", "whole.h5"}));
    EXPECT_LT(whole["from_s"], -0.49);
    EXPECT_GT(whole["to_s"], 2.9);
    const json part = replayed(with({"-o", "part.h5", "--from", "-0.1", "--to", "1.05"}));
    EXPECT_GE(part["from_s"], -0.1);
    EXPECT_LE(part["to_s"], 1.05);
    EXPECT_EQ(part["samples_compared"], 11) << "those after --to were not simulated";
    EXPECT_TRUE(part["rate_error_deg_h"].is_null());
    EXPECT_TRUE(part["agrees"]["rate_error"].is_null());
    const store::File all = open("whole.h5");
    const store::File some = open("part.h5");
    const auto off = static_cast<std::size_t>(some.int_attribute("first_turn") - all.int_attribute("first_turn"));
    EXPECT_GT(off, 0U);
    for (const char* group : {"turns", "truth", "readings", "hardware"}) {
        for (const std::string& name : all.group(group).children()) {
            const store::Dataset long_one = all.group(group).dataset(name);
            const store::Dataset short_one = some.group(group).dataset(name);
            const std::uint64_t rows = short_one.shape()[0];
            EXPECT_EQ(rows, part["turns"]) << name;
            EXPECT_TRUE(same_bits(short_one.read<double>(),
                                  [&] {
                                      const auto values = long_one.read<double>();
                                      const std::size_t columns = values.size() / long_one.shape()[0];
                                      const auto first = values.begin() + static_cast<std::ptrdiff_t>(off * columns);
                                      return std::vector<double>(first,
                                                                 first + static_cast<std::ptrdiff_t>(rows * columns));
                                  }()))
                << group << "/" << name;
        }
    }
    const json settling = replayed(with({"-o", "part.h5", "--to=-0.2"}));
    EXPECT_LE(settling["to_s"], -0.2);
    EXPECT_TRUE(settling["angle_error_arcsec"].is_null());
    EXPECT_EQ(settling["samples_compared"], 0);
    // A whole second, to its ends.
    const json second = replayed(with({"-o", "part.h5", "--from", "0", "--to", "0"}));
    EXPECT_EQ(second["turns"], 1);
}

TEST_F(ReplayCommand, TwoReplaysDifferInTheirProvenanceOnly) {
    simulate("s", with_arms(few + instrument, {"noise_injected+compensated_adaptive"}));
    const Arguments gyro{"s.h5", "--arm", "noise_injected+compensated_adaptive", "--gyro", "1"};
    Arguments first = gyro, second = gyro;
    first.insert(first.end(), {"-o", "a.h5"});
    second.insert(second.end(), {"-o", "b.h5", "--quiet"});
    ASSERT_FALSE(replayed(first).is_null());
    second.insert(second.begin(), "replay");
    const Outcome quiet = run(second);
    EXPECT_EQ(quiet.status, 0);
    EXPECT_EQ(quiet.out + quiet.err, "");
    const store::File a = open("a.h5");
    const store::File b = open("b.h5");
    for (const char* group : {"turns", "truth", "readings", "hardware"}) {
        for (const std::string& name : a.group(group).children()) {
            EXPECT_TRUE(
                same_bits(a.group(group).dataset(name).read<double>(), b.group(group).dataset(name).read<double>()))
                << name;
        }
    }
    for (const std::string& name : a.attribute_names()) {
        if (name == "format" || name == "arm") continue;
        EXPECT_TRUE(same_bits({a.double_attribute(name)}, {b.double_attribute(name)})) << name;
    }
    EXPECT_EQ(a.dataset("scenario").read<std::string>(), open("s.h5").dataset("scenario").read<std::string>());
    EXPECT_EQ(a.group("result/provenance").string_attribute("scenario_file"), "s.toml");
    EXPECT_EQ(a.group("provenance").string_attribute("scenario_file"), "s.h5");
    EXPECT_THAT(b.group("provenance").string_attribute("command_line"), HasSubstr("replay s.h5"));
    // The scenario that the replay holds runs and gives the result.
    write("again.toml", a.dataset("scenario").read<std::string>()[0]);
    ASSERT_EQ(run({"run", "again.toml", "-q", "-o", "again.h5"}).status, 0);
    expect_stored("again.h5", "noise_injected+compensated_adaptive", 1, {"--gyro", "1"});
}

TEST_F(ReplayCommand, SumsUpInWords) {
    simulate("s", with_arms(few, {"uncompensated", "noise_injected+compensated"}));
    const Outcome r = run({"replay", "s.h5", "--arm", "noise_injected+compensated", "--gyro", "2"});
    ASSERT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, StartsWith("s.h5: arm noise_injected+compensated, gyro 2\n"));
    for (const char* text : {"input_rate_deg_h:", "lockin_threshold_deg_h:", "turns:",
                             "lock-in from turn to turn, rms:", "the compensator leaves, rms:",
                             "angle error at the end:", "identical to the stored values:", "31 of 31 samples"}) {
        EXPECT_THAT(r.out, HasSubstr(text));
    }
    EXPECT_THAT(r.out, Not(HasSubstr("nan")));
    std::istringstream lines(r.out);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100U) << line;
    EXPECT_THAT(r.err, HasSubstr("s-noise_injected+compensated-gyro-2.h5\n"));
    EXPECT_EQ(left(), (std::set<std::string>{"s.toml", "s.h5", "s-noise_injected+compensated-gyro-2.h5"}));
    expect_refused({"s-noise_injected+compensated-gyro-2.h5", "--arm", "uncompensated", "--gyro", "0"},
                   HasSubstr("not a ringlock result"));
}

TEST_F(ReplayCommand, RefusesWhatIsNotThere) {
    simulate("s", with_arms(few, {"uncompensated", "compensated"}));
    expect_refused({}, HasSubstr("OUT.h5"));
    expect_refused({"none.h5", "--arm", "uncompensated", "--gyro", "0"}, HasSubstr("none.h5"));
    expect_refused({"s.toml", "--arm", "uncompensated", "--gyro", "0"}, HasSubstr("s.toml"));
    const auto arms = HasSubstr("s.h5 has uncompensated, compensated");
    expect_refused({"s.h5", "--gyro", "0"}, AllOf(HasSubstr("--arm"), arms));
    expect_refused({"s.h5", "--gyro", "0", "--arm", "ideal"}, AllOf(HasSubstr("--arm ideal"), arms));
    expect_refused({"s.h5", "--gyro", "0", "--arm", ""}, AllOf(HasSubstr("--arm"), arms));
    expect_refused({"s.h5", "--arm", "uncompensated"}, AllOf(HasSubstr("--gyro"), HasSubstr("gyros 0 to 3")));
    for (const char* gyro : {"4", "-1", "1.5", "x", "", "99999999999999999999"}) {
        expect_refused({"s.h5", "--arm", "uncompensated", "--gyro", gyro},
                       AllOf(HasSubstr("--gyro"), HasSubstr("gyros 0 to 3")));
    }
    for (const char* point : {"0", "2", "x"}) {
        expect_refused({"s.h5", "--arm", "uncompensated", "--gyro", "0", "--point", point},
                       AllOf(HasSubstr("--point"), HasSubstr("has no design")));
    }
    for (const char* time : {"x", "nan", "inf", "1s", ""}) {
        expect_refused({"s.h5", "--arm", "uncompensated", "--gyro", "0", "--from", time},
                       AllOf(HasSubstr("--from"), HasSubstr("seconds")));
        expect_refused({"s.h5", "--arm", "uncompensated", "--gyro", "0", "--to", time},
                       AllOf(HasSubstr("--to"), HasSubstr("seconds")));
    }
    for (const Arguments& range : std::vector<Arguments>{
             {"--from", "5"}, {"--to", "-2"}, {"--from", "2", "--to", "1"}, {"--from", "1.0001", "--to", "1.0002"}}) {
        Arguments all{"s.h5", "--arm", "uncompensated", "--gyro", "0"};
        all.insert(all.end(), range.begin(), range.end());
        expect_refused(all, AllOf(HasSubstr("no turn lies between"), HasSubstr("from -0.5 s to 3 s")));
    }
    expect_refused({"s.h5", "--arm", "uncompensated", "--gyro", "0", "-o", "no/r.h5"}, HasSubstr("no/r.h5"));
    expect_refused({"s.h5", "--arm", "uncompensated", "--gyro", "0", "-o", "."}, HasSubstr("."));
    expect_refused({"s.h5", "s.h5", "--arm", "uncompensated", "--gyro", "0"}, HasSubstr("--help"));
}

TEST_F(ReplayCommand, KeepsFilesThatAreNoReplayOfTheGyro) {
    simulate("s", with_arms(few, {"uncompensated", "compensated"}));
    simulate("t", with_arms(few, {"uncompensated", "compensated"}) + "[gyro]\nlockin_threshold_deg_h = 200\n");
    const Arguments gyro{"s.h5", "--arm", "compensated", "--gyro", "1", "-o"};
    const auto into = [&](const std::string& out) {
        Arguments all = gyro;
        all.push_back(out);
        return all;
    };
    replayed(into("r.h5"));
    const std::string before = read("r.h5");
    for (const Arguments& other : std::vector<Arguments>{{"s.h5", "--arm", "uncompensated", "--gyro", "1"},
                                                         {"s.h5", "--arm", "compensated", "--gyro", "0"},
                                                         {"t.h5", "--arm", "compensated", "--gyro", "1"}}) {
        Arguments all = other;
        all.insert(all.end(), {"-o", "r.h5"});
        expect_refused(all, HasSubstr("it is kept"));
        EXPECT_EQ(read("r.h5"), before);
    }
    const std::string result = read("s.h5");
    expect_refused(into("s.h5"), AllOf(HasSubstr("s.h5"), HasSubstr("are the same file")));
    EXPECT_EQ(read("s.h5"), result);
    write("notes.txt", "mine\n");
    expect_refused(into("notes.txt"), HasSubstr("it is kept"));
    EXPECT_EQ(read("notes.txt"), "mine\n");
    Arguments part = into("r.h5");
    part.insert(part.end(), {"--to", "0.5"});
    EXPECT_EQ(replayed(part)["samples_compared"], 6);
    EXPECT_LT(read("r.h5").size(), before.size()) << "a replay of the same gyro is replaced";
}

TEST_F(ReplayCommand, SaysWhereTheResultIsAnother) {
    simulate("s", with_arms(few, {"uncompensated", "noise_injected+compensated"}));
    const std::string good = read("s.h5");
    const Arguments gyro{"s.h5", "--arm", "noise_injected+compensated", "--gyro", "2", "-o", "r.h5"};
    nudge("s.h5", "arms/noise_injected+compensated/angle_arcsec", {2, 17});
    expect_refused(gyro,
                   AllOf(HasSubstr("s.h5: arm noise_injected+compensated, gyro 2"), HasSubstr("sample 17 of the angle"),
                         HasSubstr("changed after it was written")),
                   1);
    Arguments before = gyro;
    before.insert(before.end(), {"--to", "1.65"});
    EXPECT_EQ(replayed(before)["samples_compared"], 17) << "samples 0 to 16 are as they were";
    std::filesystem::remove(directory_ / "r.h5");
    replayed({"s.h5", "--arm", "noise_injected+compensated", "--gyro", "1", "-o", "r1.h5"});
    replayed({"s.h5", "--arm", "uncompensated", "--gyro", "2", "-o", "r2.h5"});

    write("s.h5", good);
    nudge("s.h5", "gyros/lockin_threshold_deg_h", {2});
    expect_refused(gyro, HasSubstr("lockin_threshold_deg_h [deg/h]"), 1);

    // By another program.
    write("s.h5", good);
    nudge("s.h5", "arms/noise_injected+compensated/angle_arcsec", {2, 0});
    change("s.h5", [](hid_t file) {
        const hid_t group = H5Gopen2(file, "provenance", H5P_DEFAULT);
        H5Adelete(group, "program_version");
        const hid_t type = H5Tcopy(H5T_C_S1);
        H5Tset_size(type, H5T_VARIABLE);
        H5Tset_cset(type, H5T_CSET_UTF8);
        const hid_t space = H5Screate(H5S_SCALAR);
        const hid_t attribute = H5Acreate2(group, "program_version", type, space, H5P_DEFAULT, H5P_DEFAULT);
        const char* text = "0.0.7";
        EXPECT_GE(H5Awrite(attribute, type, &text), 0);
        H5Aclose(attribute);
        H5Sclose(space);
        H5Tclose(type);
        H5Gclose(group);
    });
    expect_refused(gyro,
                   AllOf(HasSubstr("sample 0 "), HasSubstr("it was written by ringlock 0.0.7"),
                         HasSubstr("replay it with the program that wrote it")),
                   1);
}

TEST_F(ReplayCommand, ADamagedResultIsRefused) {
    simulate("s", with_arms(few, {"uncompensated", "compensated"}));
    const std::string good = read("s.h5");
    const Arguments gyro{"s.h5", "--arm", "compensated", "--gyro", "2", "-o", "r.h5"};
    for (const char* name :
         {"arms/compensated/angle_arcsec", "arms/compensated", "gyros/initial_phase_rad", "scenario", "provenance"}) {
        write("s.h5", good);
        change("s.h5", [&](hid_t file) { ASSERT_GE(H5Ldelete(file, name, H5P_DEFAULT), 0) << name; });
        expect_refused(gyro, AllOf(HasSubstr("s.h5"), HasSubstr(name)));
    }
    write("s.h5", good);
    change("s.h5", [&](hid_t file) {
        H5Ldelete(file, "arms/compensated/angle_arcsec", H5P_DEFAULT);
        const hsize_t extent[2] = {4, 30};
        const hid_t space = H5Screate_simple(2, extent, nullptr);
        H5Dclose(H5Dcreate2(file, "arms/compensated/angle_arcsec", H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT,
                            H5P_DEFAULT));
        H5Sclose(space);
    });
    expect_refused(gyro, AllOf(HasSubstr("[4, 30]"), HasSubstr("[4, 31]"), HasSubstr("damaged")));
    write("s.h5", good.substr(0, good.size() / 2));
    expect_refused(gyro, HasSubstr("s.h5"));
    write("s.h5", "no HDF5\n");
    expect_refused(gyro, HasSubstr("s.h5"));
}

TEST_F(ReplayCommand, ASignalLeavesNothing) {
    // Ten million turns to the first one that is written.
    simulate("l",
             "[ensemble]\ngyros = 1\nduration_s = 20000.0\n[output]\nsample_interval_s = 3600.0\n"
             "[readout]\nmodel = \"ideal\"\n[arms]\nnames = [\"uncompensated\"]\n");
    const auto before = left();
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
        const pid_t child =
            start({"replay", "l.h5", "--arm", "uncompensated", "--gyro", "0", "--from", "17000", "-o", "r.h5"});
        EXPECT_TRUE(soon([&] { return left() != before; }));
        kill(child, number);
        const Outcome r = finish(child);
        EXPECT_EQ(r.signal, number) << "status " << r.status << r.err;
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, HasSubstr("interrupted, nothing written"));
        EXPECT_EQ(left(), before);
    }
}

TEST_F(ReplayCommand, AFullDiskLeavesNothing) {
    simulate("s", with_arms(few, {"uncompensated"}));
    const auto before = left();
    for (const rlim_t bytes : {2048, 20000, 100000, 200000}) {
        const Outcome r = run({"replay", "s.h5", "--arm", "uncompensated", "--gyro", "0", "-o", "r.h5"}, [&] {
            const rlimit limit{bytes, bytes};
            setrlimit(RLIMIT_FSIZE, &limit);
        });
        EXPECT_EQ(r.status, 1) << bytes << r.err;
        EXPECT_THAT(r.err, AllOf(HasSubstr("r.h5"), HasSubstr("File too large"))) << bytes;
        EXPECT_EQ(left(), before) << bytes;
    }
    if (!std::filesystem::exists("/dev/full")) return;
    const Outcome deaf = run({"replay", "s.h5", "--arm", "uncompensated", "--gyro", "0"},
                             [] { dup2(::open("/dev/full", O_WRONLY), STDOUT_FILENO); });
    EXPECT_EQ(deaf.status, 1);
    EXPECT_THAT(deaf.err, HasSubstr("standard output cannot be written"));
}

}  // namespace
}  // namespace replay_test
}  // namespace ringlock
