#include "tests/unit/allan_losses.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "tests/cli/program.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_losses_test {

using namespace ringlock;
using testing::HasSubstr;

namespace {

class AllanLossesCommand : public test::ProgramTest {
   protected:
    test::Outcome allan(const std::vector<double>& rates, bool json) {
        std::ofstream out(directory_ / "data.txt");
        out.precision(12);
        for (const double r : rates) (std::isnan(r) ? out << "nan" : out << r) << '\n';
        out.close();
        Arguments arguments = {"allan", "data.txt", "--rate", "1", "--kind", "rate", "--unit", "deg/h", "--tau", "1"};
        if (json) arguments.emplace_back("--json");
        return run(arguments);
    }
    nlohmann::json json_of(const std::vector<double>& rates) {
        const test::Outcome outcome = allan(rates, true);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return nlohmann::json::parse(outcome.out);
    }
};

constexpr double arw_unit = 1.0 / 60.0;  // (deg/h)/sqrt(Hz) to deg/sqrt(h)

}  // namespace

// The parts without gaps have a hundred data at most; the random walk is as well known as from 88 000.
TEST_F(AllanLossesCommand, AllDataOfARecordThatLostOneSampleInEightAreUsed) {
    std::vector<double> rates = test::rates_of_angle(test::simulate_angle({.n = 0.3}, 100000, 1.0, 4));
    test::lose({0.12, 1}, 4, rates);
    const auto json = json_of(rates);
    EXPECT_EQ(json["n"], 88000);
    EXPECT_EQ(json["noise_fitted_points"], 88000);
    EXPECT_EQ(json["noise_filled_in"], 12000);
    EXPECT_EQ(json["findings"].size(), 0U);
    ASSERT_TRUE(json["noise_withheld"].is_null()) << json["noise_withheld"];
    const auto& n = json["noise"]["arw_deg_rt_h"];
    const double truth = 0.3 * arw_unit;
    const double half_width = 0.5 * (n["hi"].get<double>() - n["lo"].get<double>());
    EXPECT_NEAR(half_width, truth / std::sqrt(2.0 * 88000.0), 0.03 * half_width);
    EXPECT_NEAR(n["value"], truth, 2.5 * half_width);
}

TEST_F(AllanLossesCommand, FaultsAreFoundBetweenGaps) {
    std::vector<double> rates = test::rates_of_angle(test::simulate_angle({.n = 0.3}, 4000, 1.0, 5));
    test::lose({0.12, 1}, 5, rates);
    const auto clean = json_of(rates);
    EXPECT_EQ(clean["findings"].size(), 0U);
    std::size_t at = 1500;
    while (std::isnan(rates[at])) ++at;
    rates[at] += 30.0;
    for (std::size_t i = 2600; i < rates.size(); ++i) rates[i] += 0.6;
    const auto faulty = json_of(rates);
    ASSERT_EQ(faulty["findings"].size(), 2U);
    EXPECT_EQ(faulty["findings"][0]["kind"], "outlier");
    EXPECT_EQ(faulty["findings"][0]["row"], at + 1);
    EXPECT_NEAR(faulty["findings"][0]["size"], 30.0, 1.0);
    EXPECT_EQ(faulty["findings"][1]["kind"], "jump");
    EXPECT_NEAR(faulty["findings"][1]["size"], 0.6, 0.1);
    const double n = clean["noise"]["arw_deg_rt_h"]["value"];
    EXPECT_NEAR(faulty["noise"]["arw_deg_rt_h"]["value"], n, 0.01 * n);
    EXPECT_TRUE(faulty["noise"]["rrw_deg_h_rt_h"].is_null());
    EXPECT_THAT(allan(rates, false).out, HasSubstr("Coefficients from all 3520 data; the 480 that are missing"));
}

TEST_F(AllanLossesCommand, WhereHardlyAnyDataAreThereTheLongestPartIsFittedAndTheOutputSaysWhy) {
    std::vector<double> rates = test::rates_of_angle(test::simulate_angle({.n = 0.3}, 600, 1.0, 6));
    for (std::size_t i = 70; i + 1 < rates.size(); ++i) {
        if (i % 9 != 0) rates[i] = std::numeric_limits<double>::quiet_NaN();
    }
    const auto json = json_of(rates);
    EXPECT_EQ(json["noise_fitted_points"], 71);
    EXPECT_TRUE(json["noise_filled_in"].is_null());
    EXPECT_THAT(allan(rates, false).out, HasSubstr("more than 400000 intervals, less than a quarter of its data"));
}

}  // namespace allan_losses_test
