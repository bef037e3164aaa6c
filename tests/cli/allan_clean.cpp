#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "tests/cli/program.hpp"

// Faults that `ringlock allan` takes from the deviations when it is asked to: wraps, outliers, jumps, stretches.
namespace allan_clean_test {
namespace {

using namespace ringlock;
using testing::AllOf;
using testing::HasSubstr;

class AllanClean : public test::ProgramTest {
   protected:
    void write_values(const std::string& name, const std::vector<double>& values, const std::string& head = "") {
        std::ofstream out(directory_ / name);
        out.precision(17);
        out << head;
        for (const double v : values) out << v << '\n';
    }
    nlohmann::json json_of(Arguments arguments) {
        arguments.insert(arguments.begin(), "allan");
        arguments.emplace_back("--json");
        const test::Outcome outcome = run(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return nlohmann::json::parse(outcome.out, nullptr, false);
    }
};

std::vector<double> white(std::size_t n, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    std::vector<double> values(n);
    for (double& v : values) v = noise(random);
    return values;
}

TEST_F(AllanClean, WrapsAreUndone) {
    std::vector<double> counts = white(3000, 1);
    for (std::size_t i = 0; i < counts.size(); ++i) {
        counts[i] = std::nearbyint(1000.0 + 20.0 * counts[i] + 100.0 * static_cast<double>(i));
    }
    std::vector<double> wrapped = counts;
    for (double& c : wrapped) c -= 65536.0 * std::floor(c / 65536.0);
    write_values("counts.txt", counts);
    write_values("wrapped.txt", wrapped);
    const auto whole = json_of({"counts.txt", "--rate", "10", "--kind", "phase"});
    for (const char* const modulus : {"auto", "2^16", "65536"}) {
        const auto undone = json_of({"wrapped.txt", "--rate", "10", "--kind", "phase", "--wrap", modulus});
        EXPECT_EQ(undone["deviations"], whole["deviations"]) << modulus;
        EXPECT_EQ(undone["wraps_undone"], 4) << modulus;
        ASSERT_EQ(undone["findings"].size(), 4U);
        EXPECT_EQ(undone["findings"][0]["kind"], "wrap");
        const auto first = std::find_if(counts.begin(), counts.end(), [](double c) { return c >= 65536.0; });
        EXPECT_EQ(undone["findings"][0]["row"], first - counts.begin() + 1);
    }
    EXPECT_NE(json_of({"wrapped.txt", "--rate", "10", "--kind", "phase"})["deviations"], whole["deviations"]);
}

TEST_F(AllanClean, AWrapThatCannotBeIsRefusedWithItsCause) {
    write_values("data.txt", {1, 2, 500, 3, 4});
    const auto refused = [&](const char* const modulus) {
        const test::Outcome outcome = run({"allan", "data.txt", "--rate", "10", "--kind", "phase", "--wrap", modulus});
        EXPECT_EQ(outcome.status, 2);
        EXPECT_EQ(outcome.out, "");
        return outcome.err;
    };
    EXPECT_THAT(refused("360"), AllOf(HasSubstr("data.txt"), HasSubstr("from 1 to 500"), HasSubstr("range of 360")));
    EXPECT_THAT(refused("often"), AllOf(HasSubstr("--wrap often"), HasSubstr("2^16")));
    EXPECT_THAT(refused("-2^3"), HasSubstr("--wrap -2^3"));
}

TEST_F(AllanClean, OutliersAndJumpsAreTakenFromTheDeviations) {
    std::vector<double> rate = white(4000, 2);
    write_values("clean.txt", rate);
    rate[500] += 60.0;
    rate[900] -= 100.0;
    for (std::size_t i = 2000; i < rate.size(); ++i) rate[i] += 5.0;
    write_values("faulty.txt", rate, "# a comment\nrate\n");
    const Arguments options = {"--rate", "10", "--kind", "rate", "--unit", "deg/h"};
    const auto with = [&](const char* const file, const Arguments& more) {
        Arguments arguments = {file};
        arguments.insert(arguments.end(), options.begin(), options.end());
        arguments.insert(arguments.end(), more.begin(), more.end());
        return json_of(arguments);
    };
    const auto truth = with("clean.txt", {});
    const auto cleaned = with("faulty.txt", {"--clean"});
    EXPECT_EQ(cleaned["cleaned"]["outliers"], 2);
    EXPECT_EQ(cleaned["cleaned"]["jumps"], 1);
    EXPECT_EQ(cleaned["cleaned"]["left_out"], 0);
    EXPECT_EQ(cleaned["findings"][0]["row"], 501);
    EXPECT_EQ(cleaned["findings"][0]["line"], 503);
    for (std::size_t i = 0; i < 9; ++i) {
        const double expected = truth["deviations"]["oadev"][i]["dev"];
        EXPECT_NEAR(cleaned["deviations"]["oadev"][i]["dev"].get<double>(), expected, 0.02 * expected) << i;
    }
    const auto as_it_is = with("faulty.txt", {});
    EXPECT_TRUE(as_it_is["cleaned"].is_null());
    EXPECT_GT(as_it_is["deviations"]["oadev"][0]["dev"].get<double>(),
              1.5 * truth["deviations"]["oadev"][0]["dev"].get<double>());
    // The coefficients are the same: without the faults either way.
    EXPECT_EQ(as_it_is["noise"], cleaned["noise"]);
}

TEST_F(AllanClean, DisturbedStretchesAreLeftOut) {
    std::vector<double> rate = white(6000, 3);
    for (std::size_t i = 3000; i < 3400; ++i) rate[i] *= 20.0;
    write_values("data.txt", rate);
    const auto plain = json_of({"data.txt", "--rate", "1", "--kind", "rate", "--unit", "deg/h"});
    EXPECT_FALSE(plain["noise_withheld"].is_null());
    EXPECT_THAT(run({"allan", "data.txt", "--rate", "1", "--kind", "rate", "--unit", "deg/h"}).out,
                HasSubstr("--clean analyses the rest without these stretches"));
    const auto cleaned = json_of({"data.txt", "--rate", "1", "--kind", "rate", "--unit", "deg/h", "--clean"});
    EXPECT_TRUE(cleaned["noise_withheld"].is_null()) << cleaned["noise_withheld"];
    EXPECT_THAT(run({"allan", "data.txt", "--rate", "1", "--kind", "rate", "--unit", "deg/h", "--clean"}).out,
                AllOf(HasSubstr("are of the data without "), HasSubstr(" data of disturbed stretches"),
                      HasSubstr("missing or left out are allowed for")));
    const std::size_t left_out = cleaned["cleaned"]["left_out"];
    EXPECT_GE(left_out, 370U);  // windows overlap by half of their length
    EXPECT_LE(left_out, 700U);
    EXPECT_EQ(cleaned["n"], 6000 - left_out);
    const double n = cleaned["noise"]["arw_deg_rt_h"]["value"];
    EXPECT_NEAR(n, 1.0 / 60.0, 0.05 / 60.0);
}

TEST_F(AllanClean, RepeatedValuesAreLeftOut) {
    std::vector<double> rate = white(4000, 5);
    std::fill_n(rate.begin() + 1000, 100, rate[1000]);
    write_values("held.txt", rate);
    const Arguments options = {"held.txt", "--rate", "1", "--kind", "rate", "--unit", "deg/h"};
    const auto plain = json_of(options);
    ASSERT_EQ(plain["findings"].size(), 1U);
    EXPECT_EQ(plain["findings"][0]["kind"], "repeated");
    EXPECT_EQ(plain["n"], 4000);
    EXPECT_EQ(plain["noise_fitted_points"], 3901);
    EXPECT_EQ(plain["noise_filled_in"], 99);
    Arguments with_clean = options;
    with_clean.emplace_back("--clean");
    const auto cleaned = json_of(with_clean);
    EXPECT_EQ(cleaned["n"], 3901);
    EXPECT_EQ(cleaned["cleaned"]["left_out"], 99);
    EXPECT_EQ(cleaned["noise"], plain["noise"]);
    EXPECT_GT(cleaned["deviations"]["oadev"][0]["dev"].get<double>(),
              plain["deviations"]["oadev"][0]["dev"].get<double>());
    Arguments text = options;
    text.insert(text.begin(), "allan");
    EXPECT_THAT(run(text).out,
                AllOf(HasSubstr("without repeated values"), HasSubstr("repeat a value are allowed for")));
}

TEST_F(AllanClean, ClippedNoiseHasNoCoefficients) {
    std::vector<double> rate = white(4000, 6);
    for (double& v : rate) v = std::clamp(v, -2.0, 2.0);
    write_values("clipped.txt", rate);
    const auto clipped = json_of({"clipped.txt", "--rate", "1", "--kind", "rate", "--unit", "deg/h"});
    ASSERT_EQ(clipped["findings"].size(), 2U);
    EXPECT_EQ(clipped["findings"][0]["kind"], "clipped");
    EXPECT_THAT(clipped["noise_withheld"].get<std::string>(), HasSubstr("ends of their range"));
}

TEST_F(AllanClean, NeedsAUnitAndARecordThatIsKept) {
    write_values("data.txt", white(100, 4));
    const test::Outcome without_unit = run({"allan", "data.txt", "--rate", "1", "--kind", "rate", "--clean"});
    EXPECT_EQ(without_unit.status, 2);
    EXPECT_THAT(without_unit.err, AllOf(HasSubstr("--clean"), HasSubstr("--unit")));
    const test::Outcome stream =
        run({"allan", "data.txt", "--rate", "1", "--kind", "rate", "--stream", "--wrap", "auto"});
    EXPECT_EQ(stream.status, 2);
    EXPECT_THAT(stream.err, AllOf(HasSubstr("--wrap"), HasSubstr("--stream")));
}

}  // namespace
}  // namespace allan_clean_test
